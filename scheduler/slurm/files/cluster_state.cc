#include "scheduler/slurm/files/cluster_state.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/fields/json_fields.h"
#include "core/fields/json_text.h"
#include "core/format/artifact/artifact_fields.h"
#include "scheduler/slurm/files/cluster_folder.h"
#include "scheduler/solid/solid_rows.h"
#include "scheduler/spec/report_fields.h"

namespace voxdag {

template <class Visitor>
void fields(Visitor& visit, ExpectedSubvolume& subvolume) {
  visit("id", subvolume.id);
  fields(visit, subvolume.cube);
  visit("triangles", subvolume.triangles);
}

template <class Visitor>
void fields(Visitor& visit, AttemptEnd& end) {
  visit("task", end.task);
  visit("node", end.node);
  visit("reason", end.reason);
}

template <class Visitor>
void fields(Visitor& visit, SlurmTask& task) {
  visit("job", task.job);
  visit("index", task.index);
  visit("first", task.first_batch);
  visit("state", task.state);
  visit("node", task.node);
  visit("reason", task.reason);
}

template <class Visitor>
void fields(Visitor& visit, OpenBatch& batch) {
  visit("batch", batch.number);
  visit("subvolumes", batch.subvolumes);
  visit("weight", batch.weight);
  visit("failures", batch.failures);
  visit("task", batch.task);
}

template <class Visitor>
void fields(Visitor& visit, ClusterState& state) {
  visit("program", state.program);
  visit("build", state.build);
  visit("scene_digest", state.scene_digest);
  visit("grid_levels", state.shape.grid_levels);
  visit("hash_bits", state.shape.hash_bits);
  visit(Field("rule").omit_empty(), state.rule);  // missing in states of earlier versions
  visit(Field("solid").omit_empty(), state.solid);
  visit("submitted_s", state.submitted_s);
  visit("next_batch", state.next_batch);
  visit("split", state.totals.split);
  visit("built", state.totals);
  visit("open", state.open);
}

namespace {

constexpr uint64_t kMaxStateBytes = uint64_t{256} << 20;

}  // namespace

OpenBatch* ClusterState::find(uint32_t batch) {
  const auto found = std::ranges::lower_bound(open, batch, {}, &OpenBatch::number);
  return found == open.end() || found->number != batch ? nullptr : &*found;
}

std::string encode_state(const ClusterState& state) {
  return json_text(record_json(state), 1) + "\n";
}

ClusterState decode_state(const std::string& text) {
  auto state = record_from_text<ClusterState>(text, "the state of a cluster build");
  std::ranges::sort(state.open, {}, &OpenBatch::number);
  return state;
}

std::optional<ClusterState> read_cluster_state(FileSystem& files, const std::string& work_folder) {
  const std::string path = ClusterFolder(work_folder).state_path();
  if (!files.exists(path)) return std::nullopt;
  try {
    return decode_state(read_own_file(files, path, kMaxStateBytes));
  } catch (const Error& error) {
    // A build that has just ended removed the file.
    if (error.code() == ErrorCode::kNotFound) return std::nullopt;
    throw Error(error.code(), "the state of the cluster build " + path +
                                  " cannot be read: " + error.message() +
                                  "; if the file is damaged, remove it: the next run then repeats "
                                  "all batches that no earlier run has accepted");
  }
}

}  // namespace voxdag
