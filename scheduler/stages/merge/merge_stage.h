// The last stages of a build: the artifacts are merged into the global file, which then gets its
// name. A merge that an earlier run began is resumed. Subvolumes whose artifacts turn out damaged
// are planned again. The last groups of artifacts are made durable before a checkpoint refers to
// them.
#pragma once

#include <functional>

#include "core/base/memory_budget.h"
#include "core/format/global/global_writer.h"
#include "scheduler/spec/build_report.h"
#include "scheduler/spec/build_spec.h"
#include "scheduler/spec/stage_clock.h"
#include "scheduler/state/commit_queue.h"
#include "scheduler/state/job_store.h"
#include "scheduler/state/work_folder.h"

namespace voxdag {

// The artifacts of built subvolumes; several subvolumes may have one in common.
std::vector<ArtifactRef> distinct_artifacts(std::span<const StoredSubvolume> subvolumes);

class MergeStage {
 public:
  MergeStage(JobStore& store, CommitQueues& commits, WorkFolder& work, MemoryBudget& budget,
             StageClock& clock, const BuildContext& context)
      : store_(store),
        commits_(commits),
        work_(work),
        budget_(budget),
        clock_(clock),
        context_(context) {}

  // What follows the levels of the merged file.
  struct Sections {
    std::function<void(GlobalFileWriter& out)> add;
    // Of all that they depend on.
    std::function<std::string()> digest;
  };

  // Writes the output file and fills in the report. False if something turned out damaged, and the
  // merge is to be run again once the subvolumes that were planned again are built.
  bool run(const RunOptions& options, const Sections& sections, BuildReport& report);

 private:
  bool is_published(const Sections& sections, BuildReport& report);
  void merge(const RunOptions& options, GlobalFileWriter& out, BuildReport& report);
  void write(GlobalFileWriter& out, const Sections& sections, BuildReport& report);
  bool heal(const Error& error);

  JobStore& store_;
  CommitQueues& commits_;
  WorkFolder& work_;
  MemoryBudget& budget_;
  StageClock& clock_;
  const BuildContext& context_;
  bool restarted_ = false;
};

}  // namespace voxdag
