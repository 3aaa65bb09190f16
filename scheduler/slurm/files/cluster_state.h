// What the submitting process of a cluster build knows, in cluster.json: the batches that are not
// built, their tasks and what went wrong with them, and totals. Written by that process only, whole
// or not at all; read by `voxdag status`. Which batch a record belongs to stands here only: without
// a state, what tasks have built and no run has accepted is built again.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/dag/sub_dag.h"
#include "core/geometry/cube.h"
#include "core/io/file_system.h"
#include "scheduler/slurm/commands/slurm.h"
#include "scheduler/spec/stage_totals.h"
#include "scheduler/state/job_store.h"

namespace voxdag {

struct ExpectedSubvolume {
  SubvolumeId id = 0;
  Cube cube;

  bool operator==(const ExpectedSubvolume&) const = default;
};

struct AttemptEnd {
  std::string task, node;
  std::string reason;  // Slurm's, or the task's own error
};

struct OpenBatch {
  uint32_t number = 0;
  std::vector<ExpectedSubvolume> subvolumes;
  double weight = 0;
  std::optional<SlurmTask> task;  // as last seen; none before it is submitted
  std::vector<AttemptEnd> failures;
};

struct ClusterState {
  std::string program;  // the version of voxdag
  std::string build;    // random, in the name of the tasks
  std::string scene_digest;
  DagShape shape;
  double submitted_s = 0;  // Unix time of the first submission
  uint32_t next_batch = 0;
  std::vector<OpenBatch> open;  // by number
  ClusterTotals totals;

  std::string task_name() const { return "voxdag-" + build; }
  // Of the job that merges (merge_job.h).
  std::string merge_job_name() const { return task_name() + "-merge"; }
  OpenBatch* find(uint32_t batch);
};

std::string encode_state(const ClusterState& state);
// Throws Error{kCorrupt} for a text that encode_state() did not make.
ClusterState decode_state(const std::string& text);
// The state of the build in a work folder; nothing if there is none. Throws Error that names the
// file if it cannot be read, or is damaged.
std::optional<ClusterState> read_cluster_state(FileSystem& files, const std::string& work_folder);

}  // namespace voxdag
