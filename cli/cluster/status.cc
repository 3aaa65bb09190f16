#include <cstdio>
#include <map>
#include <optional>

#include "cli/cluster.h"
#include "core/base/error.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "scheduler/slurm/files/cluster_state.h"

namespace voxdag::cli {
namespace {

std::optional<ClusterState> read_state(FileSystem& files, const std::string& work_folder) {
  try {
    return read_cluster_state(files, work_folder);
  } catch (const Error& error) {
    std::fprintf(stderr, "voxdag: warning: %s\n", printable_line(error.what()).c_str());
    return std::nullopt;
  }
}

// Prints the number of built batches, the number of unbuilt batches for each state of their tasks,
// and for each node the numbers of built and running batches. If a task of an unbuilt batch has
// failed, also prints one such failure.
void print(const ClusterState& cluster) {
  std::map<std::string, size_t> by_state, by_node;
  const OpenBatch* failed = nullptr;
  for (const OpenBatch& batch : cluster.open) {
    ++by_state[batch.task ? batch.task->state : "not submitted"];
    if (batch.task && !batch.task->node.empty()) ++by_node[batch.task->node];
    if (!batch.failures.empty()) failed = &batch;
  }
  std::printf("  tasks %s: %s batches built, %zu open", printable_line(cluster.task_name()).c_str(),
              count_text(cluster.totals.batches).c_str(), cluster.open.size());
  for (const auto& [state, count] : by_state)
    std::printf(", %zu %s", count, printable_line(state).c_str());
  std::printf("; %s attempts failed\n", count_text(cluster.totals.attempts).c_str());
  for (const auto& [node, count] : cluster.totals.batches_of_node) by_node.try_emplace(node, 0);
  for (const auto& [node, running] : by_node) {
    const auto built = cluster.totals.batches_of_node.find(node);
    std::printf(
        "  node %s: %s built, %zu running\n", printable_line(node).c_str(),
        count_text(built == cluster.totals.batches_of_node.end() ? 0 : built->second).c_str(),
        running);
  }
  if (failed)
    std::printf("  batch %u has failed %zu times, last as task %s: %s\n", failed->number,
                failed->failures.size(), printable_line(failed->failures.back().task).c_str(),
                printable_line(failed->failures.back().reason).c_str());
}

}  // namespace

std::string cluster_status_json(FileSystem& files, const std::string& work_folder) {
  const auto state = read_state(files, work_folder);
  return state ? encode_state(*state) : "";
}

void print_cluster_status(FileSystem& files, const std::string& work_folder) {
  if (const auto state = read_state(files, work_folder)) print(*state);
}

}  // namespace voxdag::cli
