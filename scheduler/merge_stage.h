// The last stages of a build: the artifacts are merged into the global file, which then gets its
// name. What an earlier run of the job merged is gone on with; what turns out damaged is healed.
// What was built last is made durable before anything durable refers to it.
#pragma once

#include "core/base/memory_budget.h"
#include "core/base/stage_clock.h"
#include "core/format/global/global_writer.h"
#include "scheduler/build_report.h"
#include "scheduler/build_spec.h"
#include "scheduler/execute/commit_queue.h"
#include "scheduler/job/job_store.h"
#include "scheduler/job/work_folder.h"

namespace voxdag {

class MergeStage {
 public:
  MergeStage(JobStore& store, CommitQueues& journals, WorkFolder& work, MemoryBudget& budget,
             StageClock& clock, const BuildContext& context)
      : store_(store),
        journals_(journals),
        work_(work),
        budget_(budget),
        clock_(clock),
        context_(context) {}

  // Makes the file that `options` name and fills in the report. False if something turned out
  // damaged that another call may get right, once subvolumes that are planned again are built.
  bool run(const RunOptions& options, BuildReport& report);

 private:
  bool is_published(BuildReport& report);
  void merge(const RunOptions& options, GlobalFileWriter& out, BuildReport& report);
  void write(GlobalFileWriter& out, BuildReport& report);
  bool heal(const Error& error);

  JobStore& store_;
  CommitQueues& journals_;
  WorkFolder& work_;
  MemoryBudget& budget_;
  StageClock& clock_;
  const BuildContext& context_;
  bool started_over_ = false;
};

}  // namespace voxdag
