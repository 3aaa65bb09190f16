// The state of the submitting process of a cluster build, in cluster.json: open batches with their
// tasks and failures, and totals. Only the submitting process writes the file, by an atomic rename;
// `voxdag status` reads it. No other file lists the open batches and their subvolumes, which a run
// needs to accept records. So if cluster.json is lost, every batch is built again unless its record
// has been accepted.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/dag/sub_dag.h"
#include "core/geometry/cube.h"
#include "core/geometry/solid_rule.h"
#include "core/geometry/voxel_rule.h"
#include "core/io/file_system.h"
#include "scheduler/slurm/commands/slurm.h"
#include "scheduler/spec/stage_totals.h"
#include "scheduler/state/job_store.h"

namespace voxdag {

struct ExpectedSubvolume {
  SubvolumeId id = 0;
  Cube cube;
  // Number of the batch's triangles in the cube. nullopt in a state written by an earlier version.
  std::optional<uint64_t> triangles;

  bool operator==(const ExpectedSubvolume&) const = default;
};

struct AttemptEnd {
  std::string task, node;
  std::string reason;  // Slurm's reason, or the task's error
};

// Error of a batch's current attempt that is known before Slurm reports the task's end: the error
// that the task reported, the reason why its record was rejected, or Slurm's reason for not
// starting the task.
struct AttemptError {
  std::string text;
  bool has_ended = false;  // the task has ended, even if Slurm still lists it
};

struct OpenBatch {
  uint32_t number = 0;
  std::vector<ExpectedSubvolume> subvolumes;
  double weight = 0;
  std::optional<SlurmTask> task;  // as Slurm last listed it; none before submission
  std::vector<AttemptEnd> failures;
  std::optional<AttemptError> error;  // not stored in cluster.json
};

struct ClusterState {
  std::string program;  // the version of voxdag
  std::string build;    // random; part of the tasks' names
  std::string scene_digest;
  DagShape shape;
  VoxelRule rule = VoxelRule::kShell;
  SolidRule solid = SolidRule::kNone;  // the rule by which the tasks fill a solid
  double submitted_s = 0;              // Unix time of the first submission
  uint32_t next_batch = 0;
  std::vector<OpenBatch> open;  // sorted by number
  ClusterTotals totals;

  std::string task_name() const { return "voxdag-" + build; }
  // Name of the merge job (MergeJob).
  std::string merge_job_name() const { return task_name() + "-merge"; }
  OpenBatch* find(uint32_t batch);
};

std::string encode_state(const ClusterState& state);
// Decodes a state. Throws Error{kCorrupt} for a text not created by encode_state().
ClusterState decode_state(const std::string& text);
// Reads the state in a work folder; nullopt if the folder has no cluster build. Throws Error with
// the name of cluster.json if this file cannot be read or is damaged.
std::optional<ClusterState> read_cluster_state(FileSystem& files, const std::string& work_folder);

}  // namespace voxdag
