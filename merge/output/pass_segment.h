// The segment file that one round of the merge writes and later ones read.
#pragma once

#include <memory>
#include <optional>

#include "core/format/artifact/artifact.h"
#include "merge/load/scratch.h"

namespace voxdag {

// Ids from here on are those of segments in the scratch folder, below are the inputs'.
inline constexpr uint32_t kFirstRoundSegment = uint32_t{1} << 31;
inline bool is_round_segment(uint32_t id) { return id >= kFirstRoundSegment; }

class RoundSegment {
 public:
  RoundSegment(MergeScratch& scratch, MemoryBudget& budget)
      : RoundSegment(scratch, kFirstRoundSegment + scratch.take_id()) {
    writer_.emplace(scratch.files(), scratch.path(), id_, budget);
  }
  // One that an earlier merge left.
  RoundSegment(MergeScratch& scratch, uint32_t id)
      : scratch_(scratch),
        id_(id),
        path_(std::make_shared<ScratchPath>(scratch, segment_path("", id).substr(1))) {}

  uint32_t id() const { return id_; }
  SegmentWriter& writer() { return *writer_; }
  // Nothing more is written; all is on the disk.
  void finish() {
    writer_->sync();
    scratch_.count_written(writer_->size());
    writer_.reset();
  }
  std::shared_ptr<ReadableFile> open() const { return scratch_.files().open_read(path_->path()); }
  const std::shared_ptr<ScratchPath>& path() const { return path_; }

 private:
  MergeScratch& scratch_;
  const uint32_t id_;
  const std::shared_ptr<ScratchPath> path_;
  std::optional<SegmentWriter> writer_;
};

}  // namespace voxdag
