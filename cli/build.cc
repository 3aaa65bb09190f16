#include <cstdio>
#include <nlohmann/json.hpp>

#include "cli/cluster.h"
#include "cli/option_fields.h"
#include "cli/output.h"
#include "cli/syntax/resolutions.h"
#include "cli/terminal/progress_bar.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "core/fields/json_text.h"
#include "scheduler/replaced_result.h"
#include "scheduler/run_build.h"
#include "scheduler/spec/build_fields.h"

namespace voxdag::cli {
namespace {

struct BuildCommand {
  BuildSpec spec;
  std::vector<uint64_t> resolutions;
  BuildClusterOptions cluster;
  bool quiet = false;
  bool json = false;
};

constexpr const char* kEnclosedRule = "enclosed";  // the rule without sample rows

void print(const BuildReport& r) {
  std::printf("%s: %s, sha256 %s\n", printable_line(r.output).c_str(), size_text(r.bytes).c_str(),
              r.sha256.c_str());
  std::printf("  %s triangles in a grid of %lld^3\n", count_text(r.triangles).c_str(),
              static_cast<long long>(r.grid.resolution()));
  std::printf("  %s voxels, %s octree nodes, %s DAG nodes\n", count_text(r.merge.voxels).c_str(),
              count_text(r.merge.svo_nodes).c_str(), count_text(r.merge.dag_nodes).c_str());
  if (r.solid && r.solid->rule == kEnclosedRule)
    std::printf("  %s voxels inside by the rule %s\n", count_text(r.solid->interior).c_str(),
                r.solid->rule.c_str());
  else if (r.solid)
    std::printf(
        "  %s voxels inside by the rule %s, of which %s are disputed; %s of %s sample rows are "
        "open\n",
        count_text(r.solid->interior).c_str(), r.solid->rule.c_str(),
        count_text(r.solid->disputed).c_str(), count_text(r.solid->open_rows).c_str(),
        count_text(r.solid->rows).c_str());
  std::printf("  %s subvolumes (%s split), artifacts %s, spilled %s, %u merge pass%s\n",
              count_text(r.subvolumes).c_str(), count_text(r.subvolumes_split).c_str(),
              size_text(r.artifact_bytes).c_str(), size_text(r.spill_bytes).c_str(), r.merge.passes,
              r.merge.passes == 1 ? "" : "es");
  if (const auto& c = r.cluster)
    std::printf(
        "  %s batches on %zu cluster nodes, %s attempts failed, %s CPU in tasks; the tasks' merges "
        "reduced %s DAG nodes to %s\n",
        count_text(c->batches).c_str(), c->batches_of_node.size(), count_text(c->attempts).c_str(),
        duration_text(c->cpu_s).c_str(), count_text(c->rows_before).c_str(),
        count_text(c->rows_after).c_str());
  std::printf(" ");
  for (const StageTime& stage : r.stages)
    std::printf(" %s %s%s", printable_line(stage.name).c_str(), duration_text(stage.wall_s).c_str(),
                &stage == &r.stages.back() ? "\n" : ",");
  std::printf(
      "  %s wall, %s CPU, %s voxels/s, peak memory %s of %s\n", duration_text(r.wall_s).c_str(),
      duration_text(r.cpu_s).c_str(),
      count_text(static_cast<uint64_t>(static_cast<double>(r.merge.voxels) / r.wall_s)).c_str(),
      size_text(r.peak_rss_bytes).c_str(), size_text(r.memory_bytes).c_str());
}

BuildReport build(const BuildSpec& spec, bool quiet, CommandContext& context) {
  const auto progress = make_progress_bar(quiet);
  return with_option_names([&] {
    try {
      return run_build(spec, {context.files, *progress, context.cancel});
    } catch (const DoesNotFit& error) {
      throw Error(error.code(), error.message() + " (--force builds anyway)");
    }
  });
}

void run(const BuildCommand& command, CommandContext& context) {
  BuildSpec spec = command.spec;
  apply_cluster(command.cluster, spec.run);
  const std::vector<BuildSpec> builds = builds_of(spec, command.resolutions);
  if (builds.size() > 1 && spec.run.cluster && spec.run.cluster->merge_job)
    throw Error(ErrorCode::kInvalidInput,
                "--resolution: expected one resolution with --cluster-merge");
  for (const BuildSpec& one : builds) refuse_result_of_other_scene(context.files, one);
  auto reports = nlohmann::ordered_json::array();
  for (const BuildSpec& one : builds) {
    const BuildReport report = build(one, command.quiet, context);
    if (!command.json && !command.quiet) print(report);
    if (!command.json) continue;
    if (builds.size() == 1)
      print_json_text(report_json(report));
    else
      reports.push_back(parse_json<nlohmann::ordered_json>(report_json(report)));
  }
  if (!reports.empty()) print_json(nlohmann::ordered_json{{"builds", reports}});
}

void declare(Command& command, BuildCommand& state) {
  command.text_option(  // not required: --voxel-size can replace it
      "-r,--resolution", "N,...",
      [&state](const std::string& text) { state.resolutions = parse_resolutions(text); },
      resolutions_help());
  OptionDeclarer options(command, Scope::kBuild);
  options.leave_out("resolution");
  fields(options, state.spec);
  command.config_option();
  declare_cluster(command, state.cluster);
  command
      .text_option(
          "--report", "PATH|none",
          [&state](const std::string& path) { state.spec.run.report = path; },
          "file for the report, or none (default: OUT.report.json)")
      .check(path_problem)
      .group("Run (never changes the bytes of the result)");
  command.quiet_flag(state.quiet);
  command.json_flag(state.json);
}

}  // namespace

void add_build_command(CommandLine& line) {
  add_command<BuildCommand>(line, "build", "build the DAG of a scene");
}

}  // namespace voxdag::cli
