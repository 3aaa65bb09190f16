#include "scheduler/slurm/files/cluster_state.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/base/error.h"
#include "scheduler/slurm/files/cluster_folder.h"

namespace voxdag {
namespace {

using Json = nlohmann::ordered_json;

constexpr uint64_t kMaxStateBytes = uint64_t{1} << 30;

Json to_json(const OpenBatch& batch) {
  Json failures = Json::array();
  for (const AttemptEnd& f : batch.failures)
    failures.push_back({{"task", f.task}, {"node", f.node}, {"reason", f.reason}});
  Json subvolumes = Json::array();
  for (const auto& [id, cube] : batch.subvolumes)
    subvolumes.push_back({id, cube.level, cube.position[0], cube.position[1], cube.position[2]});
  Json json = {{"batch", batch.number},
               {"subvolumes", subvolumes},
               {"weight", batch.weight},
               {"failures", failures}};
  if (const auto& task = batch.task)
    json["task"] = {{"job", task->job},     {"index", task->index}, {"first", task->first_batch},
                    {"state", task->state}, {"node", task->node},   {"reason", task->reason}};
  return json;
}

OpenBatch batch_of(const Json& json) {
  OpenBatch batch;
  batch.number = json.at("batch");
  for (const Json& s : json.at("subvolumes"))
    batch.subvolumes.push_back(
        {s.at(0).get<SubvolumeId>(),
         {s.at(1).get<uint32_t>(),
          {s.at(2).get<uint32_t>(), s.at(3).get<uint32_t>(), s.at(4).get<uint32_t>()}}});
  batch.weight = json.at("weight");
  for (const Json& f : json.at("failures"))
    batch.failures.push_back({f.at("task"), f.at("node"), f.at("reason")});
  if (json.contains("task")) {
    const Json& t = json.at("task");
    batch.task = SlurmTask{.job = t.at("job"),
                           .index = t.at("index"),
                           .state = t.at("state"),
                           .reason = t.at("reason"),
                           .node = t.at("node"),
                           .first_batch = t.at("first")};
  }
  return batch;
}

}  // namespace

OpenBatch* ClusterState::find(uint32_t batch) {
  const auto found = std::ranges::lower_bound(open, batch, {}, &OpenBatch::number);
  return found == open.end() || found->number != batch ? nullptr : &*found;
}

std::string encode_state(const ClusterState& s) {
  Json open = Json::array();
  for (const OpenBatch& batch : s.open) open.push_back(to_json(batch));
  const ClusterTotals& t = s.totals;
  const Json json = {{"program", s.program},
                     {"build", s.build},
                     {"scene_digest", s.scene_digest},
                     {"grid_levels", s.shape.grid_levels},
                     {"hash_bits", s.shape.hash_bits},
                     {"submitted_s", s.submitted_s},
                     {"next_batch", s.next_batch},
                     {"built",
                      {{"batches", t.batches},
                       {"failed_attempts", t.attempts},
                       {"split", t.split},
                       {"rows_before", t.rows_before},
                       {"rows_after", t.rows_after},
                       {"cpu_s", t.cpu_s},
                       {"longest_s", t.longest_s},
                       {"first_task_s", t.first_task_s},
                       {"requests", t.requests},
                       {"batches_of_node", t.batches_of_node}}},
                     {"open", open}};
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

ClusterState decode_state(const std::string& text) {
  try {
    const Json json = Json::parse(text);
    ClusterState s;
    s.program = json.at("program");
    s.build = json.at("build");
    s.scene_digest = json.at("scene_digest");
    s.shape.grid_levels = json.at("grid_levels");
    s.shape.hash_bits = json.at("hash_bits");
    s.submitted_s = json.at("submitted_s");
    s.next_batch = json.at("next_batch");
    const Json& t = json.at("built");
    s.totals.batches = t.at("batches");
    s.totals.attempts = t.at("failed_attempts");
    s.totals.split = t.at("split");
    s.totals.rows_before = t.at("rows_before");
    s.totals.rows_after = t.at("rows_after");
    s.totals.cpu_s = t.at("cpu_s");
    s.totals.longest_s = t.at("longest_s");
    s.totals.first_task_s = t.at("first_task_s");
    s.totals.requests = t.at("requests");
    s.totals.batches_of_node = t.at("batches_of_node").get<std::map<std::string, uint64_t>>();
    for (const Json& batch : json.at("open")) s.open.push_back(batch_of(batch));
    std::ranges::sort(s.open, {}, &OpenBatch::number);
    return s;
  } catch (const nlohmann::json::exception& error) {
    throw Error(
        ErrorCode::kCorrupt,
        std::string("the state of a cluster build has other members (") + error.what() + ")");
  }
}

std::optional<ClusterState> read_cluster_state(FileSystem& files, const std::string& work_folder) {
  const std::string path = ClusterFolder(work_folder).state_path();
  if (!files.exists(path)) return std::nullopt;
  try {
    return decode_state(read_small_file(files, path, kMaxStateBytes));
  } catch (const Error& error) {
    // The build that ended just now has removed it.
    if (error.code() == ErrorCode::kNotFound) return std::nullopt;
    throw Error(error.code(), path + ": " + error.message() +
                                  ": expected the state of the tasks; without that file the "
                                  "subvolumes that no run has accepted are built again");
  }
}

}  // namespace voxdag
