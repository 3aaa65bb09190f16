#include "merge/fallback/group_stream.h"

#include <algorithm>
#include <vector>

#include "merge/fallback/cursor_merge.h"

namespace voxdag {
namespace {

constexpr uint32_t kLongestRow = 9;  // words, mask included

// One run's rows of the group in the scratch file, each its mask and its words.
struct GroupPiece {
  size_t run = 0;
  uint64_t first_row = 0;  // of the run
  uint64_t rows = 0;
  uint64_t begin_word = 0, end_word = 0;  // in the file
};

class GroupFile {
 public:
  GroupFile(const MergeContext& context, const LevelTask& task, uint64_t hash, uint64_t bytes)
      : context_(context), task_(task), hash_(hash), bytes_(bytes), file_(context.scratch) {}

  // Rewires all runs' rows of the group into the file.
  void fill() {
    PageBuffer<uint32_t> buffer(context_.budget, kBufferWords, "rows of a group of equal hashes");
    buffer_ = std::move(buffer);
    for (size_t run = 0; run < task_.runs.size(); ++run) {
      const FrameSpan frames = task_.runs[run]->frames_within({hash_, hash_});
      if (frames.begin < frames.end) add_run(run, frames);
    }
    flush();
    buffer_ = {};
  }

  std::span<const GroupPiece> pieces() const { return pieces_; }
  const ScratchFile& file() const { return file_; }

 private:
  static constexpr size_t kBufferWords = 16384;

  void add_run(size_t run, const FrameSpan& frames) {
    GroupPiece piece{run, 0, 0, written_ + buffered_, 0};
    for (size_t begin = frames.begin, end; begin < frames.end; begin = end) {
      end = frames_that_fit(*task_.runs[run], begin, frames.end);
      add_frames(piece, {begin, end});
    }
    piece.end_word = written_ + buffered_;
    if (piece.rows > 0) pieces_.push_back(piece);
  }

  size_t frames_that_fit(const LevelRun& run, size_t begin, size_t limit) const {
    size_t end = begin + 1;
    while (end < limit && Slab::bytes_for(run.rows_before(end + 1) - run.rows_before(begin),
                                          run.words_before(end + 1) - run.words_before(begin),
                                          false) <= bytes_ / 2)
      ++end;
    return end;
  }

  void add_frames(GroupPiece& piece, const FrameSpan& frames) {
    Slab slab(task_.runs, {{.run = piece.run, .frames = frames}}, {hash_, hash_}, kFrameRows, false,
              task_.memory, context_.budget);
    slab.load(task_.child_maps, {context_.plan.workers, context_.plan.worker_bytes},
              context_.budget, context_.cancel);
    const SlabBound begin = slab.bound(0, 0), end = slab.bound(slab.ranges(), 0);
    if (begin.row == end.row) return;
    if (piece.rows == 0) piece.first_row = slab.pieces()[0].first_row + begin.row;
    piece.rows += end.row - begin.row;
    const uint32_t* words = slab.words() + begin.word;
    for (uint32_t row = begin.row; row < end.row; ++row) {
      const uint8_t mask = slab.masks()[row];
      if (buffered_ + kLongestRow > kBufferWords) flush();
      buffer_[buffered_++] = mask;
      for (uint32_t i = 0; i < kRowWords[mask]; ++i) buffer_[buffered_++] = *words++;
    }
  }

  void flush() {
    if (buffered_ > 0) file_.write(written_, {buffer_.data(), buffered_});
    written_ += buffered_;
    buffered_ = 0;
  }

  const MergeContext& context_;
  const LevelTask& task_;
  const uint64_t hash_;
  const uint64_t bytes_;
  ScratchFile file_;
  std::vector<GroupPiece> pieces_;
  PageBuffer<uint32_t> buffer_;
  uint64_t written_ = 0;  // words in the file
  size_t buffered_ = 0;
};

// Walks one run's rows of the group through a buffer, and keeps their positions.
class GroupCursor {
 public:
  GroupCursor(const GroupFile& group, const GroupPiece& piece, uint64_t hash, PositionMaps& maps,
              std::span<uint32_t> rows, std::span<uint32_t> positions)
      : file_(group.file()),
        piece_(piece),
        maps_(maps),
        hash_(hash),
        buffer_(rows),
        positions_(positions),
        next_word_(piece.begin_word),
        left_(piece.rows) {
    if (left_ > 0) refill();
  }

  bool at_end() const { return left_ == 0; }
  RowKey row() const { return {hash_, static_cast<uint8_t>(buffer_[at_]), &buffer_[at_ + 1]}; }
  void advance() {
    at_ += 1 + kRowWords[buffer_[at_] & 0xff];
    if (--left_ > 0 && filled_ - at_ < kLongestRow) refill();
  }
  // The position of the row that the cursor is at.
  void keep(uint32_t position) {
    positions_[kept_++] = position;
    if (kept_ == positions_.size()) flush();
  }
  void flush() {
    maps_.store(piece_.run, piece_.first_row + stored_, positions_.first(kept_));
    stored_ += kept_;
    kept_ = 0;
  }

 private:
  void refill() {
    std::copy(buffer_.begin() + at_, buffer_.begin() + filled_, buffer_.begin());
    filled_ -= at_;
    at_ = 0;
    const uint64_t words =
        std::min<uint64_t>(buffer_.size() - filled_, piece_.end_word - next_word_);
    file_.read(next_word_, buffer_.subspan(filled_, words));
    next_word_ += words;
    filled_ += words;
  }

  const ScratchFile& file_;
  const GroupPiece& piece_;
  PositionMaps& maps_;
  const uint64_t hash_;
  std::span<uint32_t> buffer_;     // rows
  std::span<uint32_t> positions_;  // not stored yet
  uint64_t next_word_;             // of the file, not read yet
  uint64_t left_;                  // rows
  size_t at_ = 0, filled_ = 0;     // in buffer_
  uint64_t stored_ = 0;
  size_t kept_ = 0;
};

}  // namespace

LevelExtent stream_group(const MergeContext& context, const LevelTask& task, uint64_t hash,
                         uint64_t first_position, uint64_t bytes) {
  GroupFile group(context, task, hash, bytes);
  group.fill();
  task.memory.release();
  const auto pieces = group.pieces();

  OrderedRows out(task.output, task.bricks, first_position, context.budget);
  const size_t each = std::clamp<uint64_t>(bytes / 2 / sizeof(uint32_t) / pieces.size(), 64, 16384);
  PageBuffer<uint32_t> buffers(context.budget, each * pieces.size() + kLongestRowWords,
                               "a group of equal hashes");
  std::vector<GroupCursor> cursors;
  for (size_t i = 0; i < pieces.size(); ++i) {
    const std::span<uint32_t> mine(buffers.data() + i * each, each);
    cursors.emplace_back(group, pieces[i], hash, task.maps, mine.subspan(each / 4),
                         mine.first(each / 4));
  }
  uint64_t rows = 0;
  merge_cursors(std::span(cursors), [&](size_t cursor, const RowKey& row) {
    cursors[cursor].keep(static_cast<uint32_t>(out.add(row)));
    if (++rows % kFrameRows != 0) return;
    context.cancel.check();
    context.progress.advance(kFrameRows);
  });
  for (GroupCursor& cursor : cursors) cursor.flush();
  out.flush();
  context.progress.advance(rows % kFrameRows);
  return {out.nodes(), out.end_position() - first_position};
}

}  // namespace voxdag
