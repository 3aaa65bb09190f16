// The open batches of a cluster build and their accounting: which subvolumes they contain, which
// attempts failed, and the totals of built batches. A batch is a set of subvolumes that one cluster
// task builds, and an attempt is one run of such a task. A batch is open until its completion
// record is accepted, or until it is split or given up. Only the submitting process stores the
// table, in cluster.json (cluster_state.h). Used by one thread.
//
// Losing cluster.json is harmless: the subvolumes of open batches are still planned in the job
// store, so the next run makes new batches of them. Building a batch twice is harmless too: both
// results have the same bytes, and only the first valid record is accepted.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "scheduler/slurm/batches.h"
#include "scheduler/slurm/cluster_context.h"
#include "scheduler/slurm/files/cluster_state.h"
#include "scheduler/slurm/files/completion_record.h"
#include "scheduler/state/job_store.h"
#include "scheduler/triangles/triangle_store.h"

namespace voxdag {

class BatchTable {
 public:
  explicit BatchTable(ClusterContext& cluster) : cluster_(cluster) {}

  // Loads the table of an earlier run with the same scene, grid, rules and program version. (Builds
  // without cluster options accept any version.) Otherwise cancels the merge job and the tasks of
  // the earlier table, if any, and starts an empty table.
  void resume(const std::string& scene_digest, const DagShape& shape);

  const ClusterState& state() const { return state_; }
  std::vector<OpenBatch>& open() { return state_.open; }
  OpenBatch* find(uint32_t batch) { return state_.find(batch); }
  // The subvolumes of all open batches.
  std::set<SubvolumeId> subvolumes() const;
  bool is_changed() const { return is_changed_; }
  void mark_changed() { is_changed_ = true; }

  // Cuts subvolumes into new batches and writes the batch files. The triangles of subvolumes[i] are
  // in bins[i] of the store `triangles`.
  void add(std::span<const StoredSubvolume> subvolumes, std::span<const BinId> bins,
           const TriangleStore& triangles);
  // Replaces a batch by at most two batches of about equal weight. The new batches contain the
  // batch's subvolumes or, if the batch has only one subvolume, this subvolume's octants. Returns
  // the new batches' numbers.
  std::vector<uint32_t> split(uint32_t batch);
  bool can_be_split(const OpenBatch& batch) const;
  // Records the subvolumes of a built batch in the job store and closes the batch. The batch's
  // segment must already be in the work folder.
  void record_built(const CompletionRecord& record);
  void record_submission(double now_s);
  void record_failed_attempt() { ++state_.totals.attempts; }
  // Forgets earlier failures, so that each batch has the full number of retries in this run.
  void forget_failures();
  // Removes a batch and its file, and throws Error{code, why}. The next run writes a new batch file
  // from the triangles of the scene, because the removed file can be the cause of the error.
  [[noreturn]] void give_up(uint32_t batch, ErrorCode code, const std::string& why);

  void save();
  // Like save(), but a failure is only a warning: the table is written again later.
  void try_save();
  // Shows the numbers of running, waiting and built tasks.
  void show_tasks() const;

 private:
  bool is_valid(const OpenBatch& batch) const;
  void start_new(const std::string& scene_digest, const DagShape& shape);
  BatchSubvolume item_of(const StoredSubvolume& subvolume, uint64_t triangles) const;
  uint64_t tasks_for(double weight, uint64_t subvolumes) const;
  void open_batches(CutBatches cut, std::span<const BinId> bins, const TriangleStore& triangles,
                    unsigned threads, const std::function<void()>& after_each);
  std::vector<uint32_t> split_file(uint32_t batch);
  void close(uint32_t batch);
  void add_to_totals(const CompletionRecord& record);

  ClusterContext& cluster_;
  ClusterState state_;
  std::map<SubvolumeId, StoredSubvolume> rows_;  // job store rows of the open batches' subvolumes
  uint64_t earlier_requests_ = 0;                // requests to Slurm by earlier runs
  bool is_saved_ = true;                         // the last try_save() succeeded
  bool is_changed_ = false;
};

}  // namespace voxdag
