#include <cstdio>
#include <filesystem>
#include <fstream>

#include "cli/option_fields.h"
#include "cli/terminal/progress_bar.h"
#include "core/base/text.h"
#include "scheduler/run_build.h"
#include "scheduler/slurm/commands/slurm.h"
#include "scheduler/slurm/run_batch.h"
#include "scheduler/spec/build_fields.h"

namespace voxdag::cli {
namespace {

struct BuildCommand {
  BuildSpec spec;
  ClusterOptions cluster;
  bool cluster_merge = false;
  std::string merge_options;
  bool json = false;
};

void print(const BuildReport& r) {
  std::printf("%s: %s, sha256 %s\n", r.output.c_str(), size_text(r.bytes).c_str(),
              r.sha256.c_str());
  std::printf("  %s triangles in a grid of %lld^3\n", count_text(r.triangles).c_str(),
              static_cast<long long>(r.grid.resolution()));
  std::printf("  %s voxels, %s octree nodes, %s DAG nodes\n", count_text(r.merge.voxels).c_str(),
              count_text(r.merge.svo_nodes).c_str(), count_text(r.merge.dag_nodes).c_str());
  std::printf("  %s subvolumes (%s split), artifacts %s, spilled %s, %u merge pass%s\n",
              count_text(r.subvolumes).c_str(), count_text(r.subvolumes_split).c_str(),
              size_text(r.artifact_bytes).c_str(), size_text(r.spill_bytes).c_str(), r.merge.passes,
              r.merge.passes == 1 ? "" : "es");
  if (const auto& c = r.cluster)
    std::printf(
        "  %s batches on %zu nodes, %s attempts failed, %s CPU in tasks; nodes that their merges "
        "took %s, left %s\n",
        count_text(c->batches).c_str(), c->batches_of_node.size(), count_text(c->attempts).c_str(),
        duration_text(c->cpu_s).c_str(), count_text(c->rows_before).c_str(),
        count_text(c->rows_after).c_str());
  std::printf(" ");
  for (const StageTime& stage : r.stages)
    std::printf(" %s %s%s", stage.name.c_str(), duration_text(stage.wall_s).c_str(),
                &stage == &r.stages.back() ? "\n" : ",");
  std::printf(
      "  %s wall, %s CPU, %s voxels/s, peak memory %s of %s\n", duration_text(r.wall_s).c_str(),
      duration_text(r.cpu_s).c_str(),
      count_text(static_cast<uint64_t>(static_cast<double>(r.merge.voxels) / r.wall_s)).c_str(),
      size_text(r.peak_rss_bytes).c_str(), size_text(r.memory_bytes).c_str());
}

constexpr const char* kMergeJobFlag = "--cluster-merge-job";

// Returns this process's command line without the program name.
std::vector<std::string> own_arguments() {
  std::ifstream line("/proc/self/cmdline");
  std::vector<std::string> words;
  for (std::string word; std::getline(line, word, '\0');) words.push_back(word);
  if (words.size() < 2)
    throw Error(ErrorCode::kIo,
                "/proc/self/cmdline cannot be read: expected this command, for the "
                "job that merges (--cluster-merge)");
  words.erase(words.begin());
  return words;
}

// The merge job gets the user's --memory and --threads. Without these options it gets the resources
// of a task.
ClusterOptions::MergeJobOptions merge_job(const BuildCommand& command, const BuildSpec& spec) {
  ClusterOptions::MergeJobOptions job;
  job.arguments = own_arguments();
  // The first word is the command. Words after "--" are scenes, so the flag cannot be appended.
  job.arguments.insert(job.arguments.begin() + 1, kMergeJobFlag);
  job.folder = std::filesystem::current_path().string();
  if (spec.run.memory_bytes > 0)
    job.submit_options.push_back(
        "--mem=" + std::to_string(allocation_for(spec.run.memory_bytes) >> 20) + "M");
  if (spec.run.threads > 0)
    job.submit_options.push_back("--cpus-per-task=" + std::to_string(spec.run.threads));
  for (std::string& word : split_words(command.merge_options))
    job.submit_options.push_back(std::move(word));
  return job;
}

// Applies this job's Slurm allocation to the options that the user left out.
void take_allocation(RunOptions& run) {
  const Allocation given = slurm_allocation();
  if (run.memory_bytes == 0 && given.memory_bytes > 0)
    run.memory_bytes = batch_budget(given.memory_bytes);
  if (run.threads == 0) run.threads = given.cpus;
  // An earlier attempt at this job may still be ending on another node.
  run.lock_wait_s = 300;
  run.restart = false;
}

void run(const BuildCommand& command, CommandContext& context) {
  BuildSpec spec = command.spec;
  if (command.cluster.engine != ClusterEngine::kNone) {
    spec.run.cluster = command.cluster;
    spec.run.cluster->program_version = VOXDAG_VERSION;
    if (command.cluster.is_merge_job)
      take_allocation(spec.run);
    else if (command.cluster_merge)
      spec.run.cluster->merge_job = merge_job(command, spec);
  }
  const auto progress = make_progress_bar();
  const BuildReport report = [&] {
    try {
      return run_build(spec, {context.files, *progress, context.cancel});
    } catch (const DoesNotFit& error) {
      throw Error(error.code(), error.message() + " (--force builds anyway)");
    }
  }();
  if (command.json)
    std::printf("%s\n", report_json(report).c_str());
  else
    print(report);
}

void declare(Command& command, BuildCommand& state) {
  OptionDeclarer options(command, Scope::kBuild);
  fields(options, state.spec);
  command.config_option();
  fields(options, state.cluster);
  const char* const heading = kClusterHeading;
  const Option merge =
      command.flag("--cluster-merge", state.cluster_merge, "merge in a job of the cluster as well")
          .needs(options.at("cluster"))
          .group(heading);
  command
      .option("--cluster-merge-options", state.merge_options,
              "options of sbatch for the merge job, added to --cluster-options")
      .needs(merge)
      .group(heading);
  command.flag(kMergeJobFlag, state.cluster.is_merge_job, "this process is that job")
      .needs(merge)
      .group("");
  command.json_flag(state.json);
}

}  // namespace

void add_build_command(CommandLine& line) {
  add_command<BuildCommand>(line, "build", "build the DAG of a scene");
}

}  // namespace voxdag::cli
