#include "scheduler/build_report.h"

#include <nlohmann/json.hpp>

namespace voxdag {

std::string report_json(const BuildReport& report) {
  using nlohmann::ordered_json;
  ordered_json stages = ordered_json::array();
  for (const StageTime& stage : report.stages)
    stages.push_back({{"name", stage.name},
                      {"wall_s", stage.wall_s},
                      {"cpu_s", stage.cpu_s},
                      {"largest_thread_share", stage.largest_thread_share}});
  ordered_json json = {
      {"output", report.output},
      {"sha256", report.sha256},
      {"resolution", report.grid.resolution()},
      {"bounds", {{"origin", report.grid.origin}, {"edge", report.grid.edge}}},
      {"hash_bits", report.hash_bits},
      {"voxels", report.merge.voxels},
      {"svo_nodes", report.merge.svo_nodes},
      {"dag_nodes", report.merge.dag_nodes},
      {"bytes", report.bytes},
      {"triangles", report.triangles},
      {"dropped", {{"outside", report.dropped_outside}, {"invalid", report.dropped_invalid}}},
      {"subvolumes",
       {{"total", report.subvolumes},
        {"reused", report.subvolumes_reused},
        {"cached", report.subvolumes_cached},
        {"split", report.subvolumes_split}}},
      {"artifacts", {{"bytes", report.artifact_bytes}, {"nodes", report.artifact_nodes}}},
      {"spill_bytes", report.spill_bytes},
      {"merge_passes", report.merge.passes},
      {"merge_partitions", report.merge.hash_partitions},
      {"merge_streamed_groups", report.merge.streamed_groups},
      {"memory_bytes", report.memory_bytes},
      {"threads", report.threads},
      {"backend", report.backend},
      {"stages", stages},
      {"wall_s", report.wall_s},
      {"cpu_s", report.cpu_s},
      {"peak_rss_bytes", report.peak_rss_bytes},
      {"voxels_per_s",
       report.wall_s > 0 ? static_cast<double>(report.merge.voxels) / report.wall_s : 0.0},
  };
  if (const auto& c = report.cluster)
    json["cluster"] = {{"batches", c->batches},
                       {"failed_attempts", c->attempts},
                       {"cpu_s", c->cpu_s},
                       {"longest_s", c->longest_s},
                       {"first_task_s", c->first_task_s},
                       {"rows_before", c->rows_before},
                       {"rows_after", c->rows_after},
                       {"requests", c->requests},
                       {"batches_of_node", c->batches_of_node}};
  // A path need not be UTF-8; JSON must be.
  return json.dump(2, ' ', false, ordered_json::error_handler_t::replace);
}

}  // namespace voxdag
