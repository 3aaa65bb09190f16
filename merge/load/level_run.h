// Runs: the rows of one level of one artifact (or of the top tree), in the total order. The rows
// are stored in frames, which are blocks of up to kFrameRows rows. Immutable; several threads may
// read.
#pragma once

#include <cstdint>
#include <span>

#include "core/format/artifact/artifact_reader.h"
#include "merge/load/row.h"

namespace voxdag {

// The hashes from `first` to `last`, inclusive.
struct HashInterval {
  uint64_t first = 0;
  uint64_t last = ~uint64_t{0};
};

// Frames [begin, end) of a run.
struct FrameSpan {
  size_t begin = 0;
  size_t end = 0;
};

class LevelRun {
 public:
  virtual ~LevelRun() = default;
  // Decodes a frame. Several threads may call it concurrently, each with a separate `out`. A child
  // is a row index in the artifact's next deeper level; if is_rewired(), a position (row.h).
  virtual void read_frame(size_t index, Frame& out) const = 0;

  std::span<const FrameInfo> frames() const { return frames_; }
  uint64_t rows() const { return rows_; }
  const RowFormat& format() const { return format_; }
  bool bricks() const { return format_.bricks; }
  // True if children are positions (row.h); otherwise they are row indices in the artifact's next
  // deeper level.
  bool is_rewired() const { return rewired_; }

  // Returns the number of rows before frame `index`, which may be one past the last frame.
  uint64_t rows_before(size_t index) const {
    return index < frames_.size() ? frames_[index].first_row : rows_;
  }
  // Returns the number of words of the rows before frame `index`.
  uint64_t words_before(size_t index) const {
    if (format_.bricks) return kBrickWords * rows_before(index);
    return (index < frames_.size() ? frames_[index].first_child : children_) << format_.wide;
  }
  RowCount count(const FrameSpan& frames) const {
    return {rows_before(frames.end) - rows_before(frames.begin),
            words_before(frames.end) - words_before(frames.begin)};
  }
  // Returns the number of all rows and words.
  RowCount size() const { return count({0, frames_.size()}); }
  // Returns all frames that can have rows with a hash in the interval, judged by the first hash of
  // each frame.
  FrameSpan frames_within(const HashInterval& interval) const;

 protected:
  LevelRun(const RowFormat& format, bool rewired) : format_(format), rewired_(rewired) {}
  void set_frames(std::span<const FrameInfo> frames, uint64_t rows, uint64_t children) {
    frames_ = frames;
    rows_ = rows;
    children_ = children;
  }

 private:
  const RowFormat format_;
  const bool rewired_;
  std::span<const FrameInfo> frames_;
  uint64_t rows_ = 0;
  uint64_t children_ = 0;
};

// The run of one level of an artifact. The run has no rows if the artifact has no such level.
class ArtifactRun : public LevelRun {
 public:
  // `wide` is true if positions in the merged level below take two words.
  ArtifactRun(const ArtifactReader& artifact, uint32_t level, bool wide);
  void read_frame(size_t index, Frame& out) const override {
    artifact_.read_frame(level_, index, out);
  }

 private:
  const ArtifactReader& artifact_;
  const uint32_t level_;
};

}  // namespace voxdag
