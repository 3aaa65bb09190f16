// The state of the submitting process of a cluster build, in cluster.json: open batches with their
// tasks and failures, and totals. Only that process writes it, by an atomic rename; `voxdag status`
// reads it. Only this file maps records to batches: without it, results of tasks that no run has
// accepted are built again.
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
  std::string reason;  // Slurm's reason, or the task's error
};

// Why the current attempt of a batch fails, as reported before Slurm reports its end.
struct AttemptError {
  std::string text;
  bool has_ended = false;  // the task has ended, even if Slurm still lists it
};

struct OpenBatch {
  uint32_t number = 0;
  std::vector<ExpectedSubvolume> subvolumes;
  double weight = 0;
  std::optional<SlurmTask> task;  // as last seen; none before it is submitted
  std::vector<AttemptEnd> failures;
  std::optional<AttemptError> error;  // not stored in cluster.json
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
  // Name of the merge job (merge_job.h).
  std::string merge_job_name() const { return task_name() + "-merge"; }
  OpenBatch* find(uint32_t batch);
};

std::string encode_state(const ClusterState& state);
// Throws Error{kCorrupt} for a text that encode_state() did not make.
ClusterState decode_state(const std::string& text);
// Reads the state in a work folder; nullopt without a cluster build. Throws Error with the file's
// name if it cannot be read or is damaged.
std::optional<ClusterState> read_cluster_state(FileSystem& files, const std::string& work_folder);

}  // namespace voxdag
