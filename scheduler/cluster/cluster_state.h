// What the submitting process of a cluster build knows, in cluster.json: the batches that are not
// built, their tasks and what went wrong with them, and totals. Written by that process only, whole
// or not at all; read by `voxdag status`. Which batch a record belongs to stands here only: without
// a state, what tasks have built and no run has accepted is built again.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/dag/sub_dag.h"
#include "core/geometry/cube.h"
#include "core/io/file_system.h"
#include "scheduler/cluster/slurm/slurm.h"
#include "scheduler/job/job_store.h"

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

struct ClusterTotals {
  uint64_t batches = 0;   // built
  uint64_t attempts = 0;  // that failed
  uint64_t split = 0;     // subvolumes that tasks split
  uint64_t rows_before = 0, rows_after = 0;
  double cpu_s = 0;         // of all tasks whose records count
  double longest_s = 0;     // wall time of the longest of them
  double first_task_s = 0;  // from the first submission to the begin of the first task
  uint64_t requests = 0;    // to Slurm
  std::map<std::string, uint64_t> batches_of_node;
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
  // Of the job that merges (merge/merge_job.h).
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
