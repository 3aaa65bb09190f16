#include "scheduler/spec/build_report.h"

#include <bit>
#include <nlohmann/json.hpp>

#include "core/base/error.h"

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
  if (const auto& c = report.colors)
    json["colors"] = {{"resolution", c->resolution},
                      {"cells", c->cells},
                      {"images", c->images},
                      {"image_bytes", c->image_bytes},
                      {"cubes", {{"total", c->cubes}, {"reused", c->cubes_reused}}}};
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
  if (!report.merge_request.empty()) json["merge_request"] = report.merge_request;
  // A path need not be UTF-8; JSON must be.
  return json.dump(2, ' ', false, ordered_json::error_handler_t::replace);
}

BuildReport decode_report(const std::string& text) {
  try {
    const auto json = nlohmann::json::parse(text);
    BuildReport r;
    r.output = json.at("output");
    r.sha256 = json.at("sha256");
    r.grid.levels = static_cast<uint32_t>(std::countr_zero(json.at("resolution").get<uint64_t>()));
    r.grid.origin = json.at("bounds").at("origin");
    r.grid.edge = json.at("bounds").at("edge");
    r.hash_bits = json.at("hash_bits");
    r.merge.voxels = json.at("voxels");
    r.merge.svo_nodes = json.at("svo_nodes");
    r.merge.dag_nodes = json.at("dag_nodes");
    r.bytes = json.at("bytes");
    r.triangles = json.at("triangles");
    r.dropped_outside = json.at("dropped").at("outside");
    r.dropped_invalid = json.at("dropped").at("invalid");
    const auto& subvolumes = json.at("subvolumes");
    r.subvolumes = subvolumes.at("total");
    r.subvolumes_reused = subvolumes.at("reused");
    r.subvolumes_cached = subvolumes.at("cached");
    r.subvolumes_split = subvolumes.at("split");
    r.artifact_bytes = json.at("artifacts").at("bytes");
    r.artifact_nodes = json.at("artifacts").at("nodes");
    r.spill_bytes = json.at("spill_bytes");
    r.merge.passes = json.at("merge_passes");
    r.merge.hash_partitions = json.at("merge_partitions");
    r.merge.streamed_groups = json.at("merge_streamed_groups");
    r.memory_bytes = json.at("memory_bytes");
    r.threads = json.at("threads");
    r.backend = json.at("backend");
    for (const auto& stage : json.at("stages"))
      r.stages.push_back({stage.at("name"), stage.at("wall_s"), stage.at("cpu_s"),
                          stage.at("largest_thread_share")});
    r.wall_s = json.at("wall_s");
    r.cpu_s = json.at("cpu_s");
    r.peak_rss_bytes = json.at("peak_rss_bytes");
    if (json.contains("colors")) {
      const auto& c = json.at("colors");
      r.colors = ColorReport{.resolution = c.at("resolution"),
                             .cells = c.at("cells"),
                             .images = c.at("images"),
                             .image_bytes = c.at("image_bytes"),
                             .cubes = c.at("cubes").at("total"),
                             .cubes_reused = c.at("cubes").at("reused")};
    }
    if (json.contains("cluster")) {
      const auto& c = json.at("cluster");
      r.cluster.emplace();
      r.cluster->batches = c.at("batches");
      r.cluster->attempts = c.at("failed_attempts");
      r.cluster->cpu_s = c.at("cpu_s");
      r.cluster->longest_s = c.at("longest_s");
      r.cluster->first_task_s = c.at("first_task_s");
      r.cluster->rows_before = c.at("rows_before");
      r.cluster->rows_after = c.at("rows_after");
      r.cluster->requests = c.at("requests");
      r.cluster->batches_of_node = c.at("batches_of_node").get<std::map<std::string, uint64_t>>();
    }
    r.merge_request = json.value("merge_request", "");
    return r;
  } catch (const nlohmann::json::exception& error) {
    throw Error(ErrorCode::kCorrupt,
                std::string("the report of a build has other members (") + error.what() + ")");
  }
}

}  // namespace voxdag
