// Submits the tasks of open batches to Slurm and polls Slurm for their states. Resubmits batches
// whose task has ended without a record, and splits batches that ran out of time. Used by one
// thread.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "scheduler/slurm/batch_table.h"
#include "scheduler/slurm/cluster_context.h"

namespace voxdag {

class TaskPoller {
 public:
  TaskPoller(ClusterContext& cluster, BatchTable& batches) : cluster_(cluster), batches_(batches) {}

  // Begins a run. If a task fails that an earlier run started, the failure does not count in this
  // run.
  void begin_run();
  // Queries Slurm once for all tasks, then submits batches without a task. If Slurm no longer lists
  // a task, its batch must have a record after a grace period for the shared file system; otherwise
  // the attempt has failed. Throws Error with the reason of the last failure if a batch has failed
  // too often. Other tasks then continue to run.
  void poll();
  // Calls poll() if there are open batches. Then submits the merge job, which starts when all tasks
  // have ended, and returns its id. Returns "" if Slurm does not accept the job now. Also returns
  // "" if there are open batches but no tasks yet, because the job would have nothing to wait for.
  std::string try_submit_merge_job();

 private:
  using Seconds = double;

  void submit(const std::vector<uint32_t>& batches);
  void warn_refusal(const std::string& refusal);
  void warn_waiting(const SlurmTask& task);
  // Stores the task's state in its batch.
  void update(const SlurmTask& task);
  std::vector<uint32_t> end_missing(const std::set<uint32_t>& listed);
  bool is_over(const OpenBatch& batch);
  void cancel_held(const std::vector<SlurmTask>& tasks, std::set<uint32_t>& listed);
  // The next step for a batch whose task Slurm does not list. kWait: the task can still be active.
  // kStop: Slurm does not answer, so the remaining batches are not examined either.
  enum class Next { kWait, kStop, kResubmit, kSplit };
  Next end_attempt(OpenBatch& batch);
  void fail_attempt(OpenBatch& batch, const SlurmEnd& end, bool is_split);
  std::string find_job(const std::string& name);

  ClusterContext& cluster_;
  BatchTable& batches_;
  std::map<uint32_t, Seconds> missing_since_;  // batches whose tasks Slurm does not list
  std::set<uint32_t> inherited_;               // batches with tasks of an earlier run
  std::set<std::string> warned_reasons_;       // reported reasons why tasks wait
  bool is_answering_ = true;                   // Slurm answered the last query
  bool is_accepting_ = true;                   // Slurm accepted the last submission
};

}  // namespace voxdag
