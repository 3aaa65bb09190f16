#include <chrono>
#include <cstdio>
#include <map>
#include <optional>
#include <thread>

#include "cli/command.h"
#include "core/base/text.h"
#include "scheduler/slurm/files/cluster_state.h"
#include "scheduler/state/job_status.h"
#include "scheduler/state/work_folder.h"

namespace voxdag::cli {
namespace {

struct StatusCommand {
  std::string work_folder;
  bool json = false;
  bool watch = false;
};

// Prints the unbuilt batches, grouped by the state of their tasks, and the last failure.
void print(const ClusterState& cluster) {
  std::map<std::string, size_t> by_state, by_node;
  const OpenBatch* failed = nullptr;
  for (const OpenBatch& batch : cluster.open) {
    ++by_state[batch.task ? batch.task->state : "not submitted"];
    if (batch.task && !batch.task->node.empty()) ++by_node[batch.task->node];
    if (!batch.failures.empty()) failed = &batch;
  }
  std::printf("  tasks %s: %s batches built, %zu open", cluster.task_name().c_str(),
              count_text(cluster.totals.batches).c_str(), cluster.open.size());
  for (const auto& [state, count] : by_state) std::printf(", %zu %s", count, state.c_str());
  std::printf("; %s attempts failed\n", count_text(cluster.totals.attempts).c_str());
  for (const auto& [node, count] : cluster.totals.batches_of_node) by_node.try_emplace(node, 0);
  for (const auto& [node, running] : by_node) {
    const auto built = cluster.totals.batches_of_node.find(node);
    std::printf(
        "  node %s: %s built, %zu running\n", node.c_str(),
        count_text(built == cluster.totals.batches_of_node.end() ? 0 : built->second).c_str(),
        running);
  }
  if (failed)
    std::printf("  batch %u has failed %zu times, last as task %s: %s\n", failed->number,
                failed->failures.size(), failed->failures.back().task.c_str(),
                failed->failures.back().reason.c_str());
}

void print(const JobStatus& status, const std::optional<ClusterState>& cluster) {
  std::printf("%s; %s of %s subvolumes built\n",
              status.running ? ("being built by " + status.holder).c_str() : "not running",
              count_text(status.built).c_str(), count_text(status.subvolumes).c_str());
  if (const auto& p = status.progress) {
    std::printf("  stage %s: %s of %s %s, %s/s", p->stage.c_str(), count_text(p->done).c_str(),
                count_text(p->total).c_str(), p->unit.c_str(),
                count_text(static_cast<uint64_t>(status.rate())).c_str());
    if (status.running && status.eta_s() > 0)
      std::printf(", %s left", duration_text(status.eta_s()).c_str());
    std::printf("\n  memory %s, disk %s\n", size_text(p->memory_bytes).c_str(),
                size_text(p->disk_bytes).c_str());
    if (!p->last_error.empty()) std::printf("  last error: %s\n", p->last_error.c_str());
  }
  if (cluster) print(*cluster);
  for (const StageTime& stage : status.stages)
    std::printf("  %-10s %s wall, %s CPU\n", stage.name.c_str(),
                duration_text(stage.wall_s).c_str(), duration_text(stage.cpu_s).c_str());
}

void run(const StatusCommand& command, CommandContext& context) {
  for (bool first = true;; first = false) {
    // A build that finishes between two queries removes its work folder.
    if (!first && !context.files.exists(WorkFolder::store_path(command.work_folder))) return;
    const JobStatus status = read_job_status(context.files, command.work_folder);
    std::optional<ClusterState> cluster;
    try {
      cluster = read_cluster_state(context.files, command.work_folder);
    } catch (const Error& error) {
      std::fprintf(stderr, "voxdag: %s\n", error.what());
    }
    if (command.json)
      std::printf("%s\n", status_json(status, cluster ? encode_state(*cluster) : "").c_str());
    else
      print(status, cluster);
    std::fflush(stdout);
    if (!command.watch || !status.running) return;
    std::this_thread::sleep_for(std::chrono::seconds(1));
    context.cancel.check();
  }
}

void declare(Command& command, StatusCommand& state) {
  command.option("work", state.work_folder, "the work folder, OUT.vdag.work by default").required();
  command.json_flag(state.json);
  command.flag("--watch", state.watch, "repeat every second until the build ends");
}

}  // namespace

void add_status_command(CommandLine& line) {
  add_command<StatusCommand>(line, "status", "print the state and progress of a build");
}

}  // namespace voxdag::cli
