// The shared state of a merge's steps: the context of the merge, and the task of one level.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "core/base/memory_budget.h"
#include "core/base/progress.h"
#include "merge/load/hash_partition.h"
#include "merge/load/level_run.h"
#include "merge/load/position_maps.h"
#include "merge/load/scratch_file.h"
#include "merge/output/level_output.h"
#include "merge/plan/merge_memory.h"
#include "merge/types/merge_report.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// Progress whose total can be corrected later.
class MergeProgress {
 public:
  explicit MergeProgress(Progress& progress) : progress_(progress) {}
  // Begins with a total of `total` rows. A resumed merge has already merged `done` of them.
  void begin(uint64_t total, uint64_t done) {
    progress_.begin_stage("merge", total_ = total, "nodes");
    progress_.resume_at(done);
  }
  void set_total(uint64_t total) { progress_.set_total(total_ = total); }
  void expect_more(uint64_t rows) {
    if (rows > 0) set_total(total_ + rows);
  }
  void advance(uint64_t rows) { progress_.advance(rows); }
  void end() { progress_.end_stage(); }
  void warn(const std::string& message) { progress_.warn(message); }

 private:
  Progress& progress_;
  uint64_t total_ = 0;
};

struct MergeContext {
  ScratchFolder& scratch;
  MemoryBudget& budget;
  MergeMemory plan;
  MergeProgress& progress;
  const CancelToken& cancel;
  MergeReport& report;
};

struct LevelTask {
  uint32_t level = 0;
  RowFormat format;
  std::span<const LevelRun* const> runs;
  const PositionMaps* child_maps =
      nullptr;              // maps of the level below, one per run; null for bricks
  PositionMaps& maps;       // filled by the merge of the level
  LevelOutput& output;      // used between begin_level() and end_level()
  PartitionMemory& memory;  // reused from level to level
};

}  // namespace voxdag
