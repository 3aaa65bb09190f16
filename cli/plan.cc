#include <cstdio>

#include "cli/cluster.h"
#include "cli/option_fields.h"
#include "cli/output.h"
#include "cli/terminal/progress_bar.h"
#include "core/base/text.h"
#include "scheduler/plan_build.h"
#include "scheduler/spec/build_fields.h"
#include "scheduler/stages/plan/cluster_plan.h"

namespace voxdag::cli {
namespace {

struct PlanCommand {
  BuildSpec spec;
  ClusterOptions cluster;
  bool quiet = false;
  bool json = false;
};

template <class Text>
void print_range(const char* name, const EstimateRange& range, const Text& text) {
  std::printf("  %-16s %s   (%s to %s)\n", name, text(range.likely).c_str(),
              text(range.low).c_str(), text(range.high).c_str());
}

void print(const Estimate& e) {
  const auto count = [](double value) { return count_text(static_cast<uint64_t>(value)); };
  const auto size = [](double value) { return size_text(static_cast<uint64_t>(value)); };
  std::printf("%s triangles, %s occupied subvolumes; estimated from builds at %s^3 and below:\n",
              count_text(e.triangles).c_str(), count_text(e.subvolumes).c_str(),
              count_text(e.pilot_resolution).c_str());
  print_range("voxels", e.voxels, count);
  if (e.solid) print_range("voxels inside", e.solid->interior, count);
  print_range("octree nodes", e.svo_nodes, count);
  print_range("DAG nodes", e.dag_nodes, count);
  print_range("global file", e.file_bytes, size);
  if (e.colors) print_range("colors in it", e.colors->file_bytes, size);
  print_range("disk, at most", e.disk_bytes, size);
  print_range("memory, at most", e.memory_bytes, size);
  print_range("CPU time", e.cpu_s, duration_text);
  print_range("wall time", e.wall_s, duration_text);
  std::printf("  free: %s of disk; memory budget %s\n", size_text(e.free_disk).c_str(),
              size_text(e.free_memory).c_str());
}

void print(const ClusterPlan& plan) {
  const auto size = [](double value) { return size_text(static_cast<uint64_t>(value)); };
  const auto hours = [](double value) { return duration_text(3600 * value); };
  std::printf("on the cluster: %s tasks of %s or more\n", count_text(plan.tasks).c_str(),
              size_text(plan.memory_bytes).c_str());
  print_range("CPU of all tasks", plan.cpu_hours, hours);
  print_range("a task, one CPU", plan.task_s, duration_text);
  print_range("merge, one CPU", plan.merge_s, duration_text);
  print_range("shared disk", plan.shared_bytes, size);
}

void run(const PlanCommand& command, CommandContext& context) {
  const auto progress = make_progress_bar(command.quiet);
  const Estimate estimate = with_option_names([&] {
    return plan_build(command.spec, {context.files, *progress, context.cancel});
  });
  if (command.cluster.engine == ClusterEngine::kNone) {
    if (command.json)
      print_json_text(estimate_json(estimate));
    else
      print(estimate);
    return;
  }
  const ClusterPlan plan = plan_cluster(estimate, command.cluster.tasks);
  if (command.json) {
    print_json_text(cluster_plan_json(estimate, plan));
  } else {
    print(estimate);
    print(plan);
  }
}

void declare(Command& command, PlanCommand& state) {
  OptionDeclarer options(command, Scope::kPlan);
  fields(options, state.spec);
  options.at("resolution").optional();  // --voxel-size can replace it
  command.config_option();
  declare_cluster(command, state.cluster);
  command.quiet_flag(state.quiet, "print only the estimate, warnings and errors");
  command.json_flag(state.json);
}

}  // namespace

void add_plan_command(CommandLine& line) {
  add_command<PlanCommand>(line, "plan",
                           "estimate the size, memory, disk space and time of a build");
}

}  // namespace voxdag::cli
