#include <filesystem>
#include <fstream>

#include "cli/cluster.h"
#include "cli/option_fields.h"
#include "core/base/error.h"
#include "scheduler/slurm/commands/slurm.h"
#include "scheduler/slurm/run_batch.h"
#include "scheduler/spec/build_fields.h"

namespace voxdag::cli {
namespace {

constexpr const char* kMergeJobFlag = "--cluster-merge-job";

// Returns the arguments of this process, without the program name.
std::vector<std::string> own_arguments() {
  std::ifstream line("/proc/self/cmdline");
  std::vector<std::string> words;
  for (std::string word; std::getline(line, word, '\0');) words.push_back(word);
  if (words.size() < 2)
    throw Error(ErrorCode::kIo,
                "/proc/self/cmdline cannot be read or has no arguments: expected the arguments of "
                "this command, which the job that merges needs (--cluster-merge)");
  words.erase(words.begin());
  return words;
}

// Returns the command of the merge job, and the job's options for sbatch. The options are made from
// the user's --memory and --threads, followed by the user's --cluster-merge-options. Without
// --memory, the merge job gets as much memory as a task; without --threads, as many CPUs.
ClusterOptions::MergeJobOptions merge_job(const BuildClusterOptions& cluster,
                                          const RunOptions& run) {
  ClusterOptions::MergeJobOptions job;
  job.arguments = own_arguments();
  // Inserts the flag after the first word, which is the name of the command. The flag cannot be
  // appended, because words after "--" are scenes.
  job.arguments.insert(job.arguments.begin() + 1, kMergeJobFlag);
  job.folder = std::filesystem::current_path().string();
  if (run.memory_bytes > 0)
    job.submit_options.push_back("--mem=" + std::to_string(allocation_for(run.memory_bytes) >> 20) +
                                 "M");
  if (run.threads > 0)
    job.submit_options.push_back("--cpus-per-task=" + std::to_string(run.threads));
  for (std::string& word : split_words(cluster.merge_options))
    job.submit_options.push_back(std::move(word));
  return job;
}

// Called in the process of a merge job. Memory and threads that the user did not give are set to
// the values of the job's Slurm allocation.
void take_allocation(RunOptions& run) {
  const Allocation given = slurm_allocation();
  if (run.memory_bytes == 0 && given.memory_bytes > 0)
    run.memory_bytes = batch_budget(given.memory_bytes);
  if (run.threads == 0) run.threads = given.cpus;
  // An earlier attempt of this job can still hold the lock of the build while it ends on another
  // node. So this process waits longer for the lock than other commands do.
  run.lock_wait_s = 300;
  run.restart = false;
}

}  // namespace

void declare_cluster(Command& command, BuildClusterOptions& state) {
  OptionDeclarer options(command, Scope::kBuild);
  fields(options, state.options);
  const char* const heading = kClusterHeading;
  const Option merge =
      command.flag("--cluster-merge", state.has_merge_job, "merge in a job of the cluster as well")
          .needs(options.at("cluster"))
          .group(heading);
  command
      .option("--cluster-merge-options", state.merge_options,
              "options of sbatch for the merge job, added to --cluster-options")
      .needs(merge)
      .group(heading);
  command.flag(kMergeJobFlag, state.options.is_merge_job, "this process is that job")
      .needs(merge)
      .group("");
}

void apply_cluster(const BuildClusterOptions& cluster, RunOptions& run) {
  if (cluster.options.engine == ClusterEngine::kNone) return;
  run.cluster = cluster.options;
  run.cluster->program_version = VOXDAG_VERSION;
  if (cluster.options.is_merge_job)
    take_allocation(run);
  else if (cluster.has_merge_job)
    run.cluster->merge_job = merge_job(cluster, run);
}

void declare_cluster(Command& command, ClusterOptions& options) {
  OptionDeclarer declarer(command, Scope::kPlan);
  fields(declarer, options);
}

}  // namespace voxdag::cli
