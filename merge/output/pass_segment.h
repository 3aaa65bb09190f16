// The segment file that one merge pass writes and later passes read.
#pragma once

#include <memory>
#include <optional>

#include "core/format/artifact/segment_writer.h"
#include "merge/load/scratch_file.h"

namespace voxdag {

// Smallest id of a segment in the scratch folder; the inputs' segments have lower ids.
inline constexpr uint32_t kFirstPassSegment = uint32_t{1} << 31;
inline bool is_pass_segment(uint32_t id) { return id >= kFirstPassSegment; }

class PassSegment {
 public:
  PassSegment(ScratchFolder& scratch, MemoryBudget& budget)
      : PassSegment(scratch, kFirstPassSegment + scratch.next_id()) {
    scratch.make();
    writer_.emplace(scratch.files(), scratch.path(), id_, budget);
  }
  // Opens the segment left by an earlier merge.
  PassSegment(ScratchFolder& scratch, uint32_t id)
      : scratch_(scratch),
        id_(id),
        path_(std::make_shared<ScratchPath>(scratch, segment_path("", id).substr(1))) {}

  uint32_t id() const { return id_; }
  SegmentWriter& writer() { return *writer_; }
  // Syncs the file. Nothing may be written afterwards.
  void finish() {
    writer_->sync();
    scratch_.count_written(writer_->size());
    writer_.reset();
  }
  std::shared_ptr<ReadableFile> open() const { return scratch_.files().open_own(path_->path()); }
  const std::shared_ptr<ScratchPath>& path() const { return path_; }

 private:
  ScratchFolder& scratch_;
  const uint32_t id_;
  const std::shared_ptr<ScratchPath> path_;
  std::optional<SegmentWriter> writer_;
};

}  // namespace voxdag
