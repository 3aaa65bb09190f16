#include <cstdio>

#include "cli/build_options.h"
#include "cli/terminal/progress_bar.h"
#include "core/base/text.h"
#include "scheduler/plan/estimate.h"

namespace voxdag::cli {
namespace {

struct PlanCommand {
  BuildOptions options;
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
  print_range("octree nodes", e.svo_nodes, count);
  print_range("DAG nodes", e.dag_nodes, count);
  print_range("global file", e.file_bytes, size);
  print_range("disk, at most", e.disk_bytes, size);
  print_range("memory, at most", e.memory_bytes, size);
  print_range("CPU time", e.cpu_s, duration_text);
  print_range("wall time", e.wall_s, duration_text);
  std::printf("  free: %s of disk; memory budget %s\n", size_text(e.free_disk).c_str(),
              size_text(e.free_memory).c_str());
}

void run(const PlanCommand& command, CommandContext& context) {
  const auto progress = make_progress_bar();
  const Estimate estimate =
      plan_build(command.options.spec(), {context.files, *progress, context.cancel});
  if (command.json)
    std::printf("%s\n", estimate_json(estimate).c_str());
  else
    print(estimate);
}

void declare(Command& command, PlanCommand& state) {
  state.options.declare(command);
  state.options.declare_work_folder(command);
  command.json_flag(state.json);
}

}  // namespace

void add_plan_command(CommandLine& line) {
  add_command<PlanCommand>(
      line, "plan", "estimate the size, memory, disk space and time of a build", declare, run);
}

}  // namespace voxdag::cli
