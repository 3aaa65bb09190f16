// The submitting process of a cluster build: cuts subvolumes into batches, submits a task for each,
// follows them, submits again what failed, and records in the job store what they have built. The
// build then goes through the merge as any other.
//
// Nothing that a valid record names is built again, and bytes are canonical, so that it does no
// harm if a batch is built twice: after this process was killed between submission and the next
// save of its state, or when Slurm believes a node lost on which a task still runs. The first valid
// record counts.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "scheduler/slurm/batches.h"
#include "scheduler/slurm/commands/slurm.h"
#include "scheduler/slurm/files/batch_file.h"
#include "scheduler/slurm/files/cluster_folder.h"
#include "scheduler/slurm/files/cluster_state.h"
#include "scheduler/slurm/files/completion_record.h"
#include "scheduler/slurm/files/record_check.h"
#include "scheduler/spec/build_spec.h"
#include "scheduler/state/job_store.h"
#include "scheduler/state/work_folder.h"
#include "scheduler/triangles/memory_store.h"

namespace voxdag {

class ClusterBuild {
 public:
  // Without cluster options it can take over what tasks have built, but not submit any. `spec` must
  // outlive this.
  ClusterBuild(const BuildSpec& spec, const WorkFolder& work, JobStore& jobs,
               const BuildContext& context, CommandRunner& commands);

  // Stops all tasks of the build in a work folder, if there is one, and first the job that merges,
  // unless this process is that job. Throws Error{kIo} naming them if Slurm does not take that.
  static void stop_tasks(FileSystem& files, const std::string& work_folder, CommandRunner& commands,
                         bool is_merge_job = false);
  // Stops that job only. Returns whether Slurm has taken it.
  static bool stop_merge_job(FileSystem& files, const std::string& work_folder,
                             CommandRunner& commands);

  // Throws Error{kInvalidInput} if there is no Slurm here, or if it would refuse the tasks of a
  // build with cluster options.
  static void check(const BuildSpec& spec, CommandRunner& commands, const BuildContext& context);
  // Takes over what an earlier run has left for the scene, and records what was built since then.
  // What is left of another build or another version is given up.
  void resume(const std::string& scene_digest, const DagShape& shape);
  // The subvolumes of batches that are not built.
  std::set<SubvolumeId> covered() const;
  // Makes batches of further subvolumes, whose triangles are in `bins`.
  void add(std::span<const StoredSubvolume> subvolumes, std::span<const BinId> bins,
           const TriangleStore& triangles, unsigned threads);
  // Submits what is not submitted, and returns when all batches are built. Throws Error with the
  // last reason if a batch has failed too often; what runs, runs on.
  void follow();

  // Instead of follow(): submits what Slurm takes now, and a job that merges when that has ended.
  // Returns the job's id. What was not taken, or fails, is for that job.
  std::string submit_merge_job();

  const ClusterTotals& totals() const { return state_.totals; }

 private:
  using Seconds = double;
  // Why a task failed, as it said itself. A record that does not count may be an earlier task's:
  // then the last one need not have ended.
  struct OwnReason {
    std::string text;
    bool has_ended;
  };

  void save_state();
  void try_to_save_state();
  uint64_t tasks_for(double weight, uint64_t subvolumes) const;
  void open_batches(CutBatches cut, std::span<const BinId> bins, const TriangleStore& triangles,
                    unsigned threads, const std::function<void()>& after_each);
  void forget_failures();
  std::string program() const;
  void submit(const std::vector<uint32_t>& batches);
  std::string find_job(const std::string& name);
  void note_refusal(const std::string& refusal);
  void accept_finished();
  void take_failure(const ClusterFolder::Entry& entry);
  bool is_of_this_job(const OpenBatch& batch) const;
  void take_record(const ClusterFolder::Entry& entry);
  void accept(const CompletionRecord& record);
  void look_after_tasks();
  void report_tasks() const;
  // False if Slurm does not answer.
  bool end_attempt(OpenBatch& batch, std::vector<uint32_t>& again, std::vector<uint32_t>& to_split);
  bool says_that_it_ended(const OpenBatch& batch) const;
  void cancel_given_up(const std::vector<SlurmTask>& tasks, std::set<uint32_t>& listed);
  void note_reason(const SlurmTask& task);
  [[noreturn]] void give_up(uint32_t batch, ErrorCode code, const std::string& why);
  bool can_be_split(const OpenBatch& batch) const;
  std::vector<uint32_t> split(uint32_t batch);
  std::vector<uint32_t> split_batch(uint32_t batch);
  void remove_leftovers();

  const BuildSpec& spec_;
  const ClusterOptions& options_;
  const WorkFolder& work_;
  JobStore& jobs_;
  const BuildContext& context_;
  FileSystem& files_;
  const ClusterFolder folder_;
  Slurm slurm_;
  ClusterState state_;
  std::map<SubvolumeId, StoredSubvolume> subvolumes_;  // of open batches
  std::map<uint32_t, Seconds> missing_since_;          // batches whose tasks Slurm does not list
  std::map<std::string, Seconds> incomplete_since_;    // records whose segments are not there yet
  std::map<uint32_t, OwnReason> own_reasons_;          // by batch
  uint64_t earlier_requests_ = 0;
  std::set<uint32_t> inherited_;                 // batches with tasks of an earlier run
  std::set<std::string> noted_reasons_;          // why tasks wait
  bool is_answering_ = true, is_taking_ = true;  // Slurm: questions, tasks
  bool is_saved_ = true;
  bool is_changed_ = false;
};

}  // namespace voxdag
