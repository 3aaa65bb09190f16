#include "merge/fallback/hash_group_merge.h"

#include <algorithm>
#include <vector>

#include "merge/fallback/heap_merge.h"

namespace voxdag {
namespace {

// Maximum words of a row in the scratch file: its mask and its words.
constexpr uint32_t kMaxEncodedWords = 1 + kMaxRowWords;

// The rows of one run (merge/load/row.h) that belong to the group of all rows with one hash.
struct GroupRun {
  size_t run = 0;
  uint64_t first_row = 0;  // index, in the run, of the group's first row
  uint64_t rows = 0;
  uint64_t begin_word = 0, end_word = 0;  // the rows' words in the scratch file
};

class GroupFile {
 public:
  GroupFile(const MergeContext& context, const LevelTask& task, uint64_t hash, uint64_t bytes)
      : context_(context), task_(task), hash_(hash), bytes_(bytes), file_(context.scratch) {}

  // Writes the group's rows of all runs to the file, with positions instead of child indices.
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

  std::span<const GroupRun> runs() const { return runs_; }
  const ScratchFile& file() const { return file_; }

 private:
  static constexpr size_t kBufferWords = 16384;

  void add_run(size_t run, const FrameSpan& frames) {
    GroupRun group_run{run, 0, 0, written_ + buffered_, 0};
    for (size_t begin = frames.begin, end; begin < frames.end; begin = end) {
      end = frames_that_fit(*task_.runs[run], begin, frames.end);
      add_frames(group_run, {begin, end});
    }
    group_run.end_word = written_ + buffered_;
    if (group_run.rows > 0) runs_.push_back(group_run);
  }

  size_t frames_that_fit(const LevelRun& run, size_t begin, size_t limit) const {
    const uint64_t bytes = std::min(bytes_ / 2, kMaxPartitionBytes);
    size_t end = begin + 1;
    while (end < limit && HashPartition::bytes_for(run.count({begin, end + 1}), 0) <= bytes) ++end;
    return end;
  }

  void add_frames(GroupRun& group_run, const FrameSpan& frames) {
    HashPartition part(task_.runs, {{.run = group_run.run, .frames = frames}}, {hash_, hash_},
                       kFrameRows, 0, task_.memory, context_.budget);
    part.load(task_.child_maps, {context_.plan.workers, context_.plan.worker_bytes},
              context_.budget, context_.cancel);
    const RowOffset begin = part.bucket_begin(0, 0);
    const RowOffset end = part.bucket_begin(part.bucket_count(), 0);
    if (begin.row == end.row) return;
    if (group_run.rows == 0) group_run.first_row = part.slices()[0].first_row + begin.row;
    group_run.rows += end.row - begin.row;
    const uint32_t* words = part.words() + begin.word;
    for (uint32_t row = begin.row; row < end.row; ++row) {
      const uint8_t mask = part.masks()[row];
      if (buffered_ + kMaxEncodedWords > kBufferWords) flush();
      buffer_[buffered_++] = mask;
      for (uint32_t i = task_.format.words(mask); i > 0; --i) buffer_[buffered_++] = *words++;
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
  std::vector<GroupRun> runs_;
  PageBuffer<uint32_t> buffer_;
  uint64_t written_ = 0;  // words written to the file
  size_t buffered_ = 0;
};

// Reads the rows of a GroupRun through a buffer, and stores the rows' positions in PositionMaps.
class GroupCursor {
 public:
  GroupCursor(const ScratchFile& file, const GroupRun& run, const RowFormat& format, uint64_t hash,
              PositionMaps& maps, std::span<uint32_t> rows, std::span<uint32_t> positions)
      : file_(file),
        run_(run),
        format_(format),
        maps_(maps),
        hash_(hash),
        buffer_(rows),
        positions_(positions),
        next_word_(run.begin_word),
        rows_left_(run.rows) {
    if (rows_left_ > 0) refill();
  }

  bool at_end() const { return rows_left_ == 0; }
  RowKey row() const { return {hash_, static_cast<uint8_t>(buffer_[at_]), &buffer_[at_ + 1]}; }
  void advance() {
    at_ += 1 + format_.words(static_cast<uint8_t>(buffer_[at_]));
    if (--rows_left_ > 0 && filled_ - at_ < kMaxEncodedWords) refill();
  }
  // Sets the position of the current row.
  void set_position(uint64_t position) {
    put_position(&positions_[pending_], position, maps_.wide());
    pending_ += maps_.position_words();
    if (pending_ == positions_.size()) flush();
  }
  void flush() {
    maps_.store(run_.run, run_.first_row + stored_, positions_.first(pending_));
    stored_ += pending_ / maps_.position_words();
    pending_ = 0;
  }

 private:
  void refill() {
    std::copy(buffer_.begin() + at_, buffer_.begin() + filled_, buffer_.begin());
    filled_ -= at_;
    at_ = 0;
    const uint64_t words = std::min<uint64_t>(buffer_.size() - filled_, run_.end_word - next_word_);
    file_.read(next_word_, buffer_.subspan(filled_, words));
    next_word_ += words;
    filled_ += words;
  }

  const ScratchFile& file_;
  const GroupRun& run_;
  const RowFormat format_;
  PositionMaps& maps_;
  const uint64_t hash_;
  std::span<uint32_t> buffer_;  // encoded rows
  // Buffer with an even number of words. The first `pending_` words are positions that are not yet
  // stored in maps_.
  std::span<uint32_t> positions_;
  uint64_t next_word_;  // index of the first word of the file that is not read yet
  uint64_t rows_left_;
  size_t at_ = 0, filled_ = 0;  // word indices in buffer_: current row, end of the rows
  uint64_t stored_ = 0;         // rows whose positions were stored in maps_
  size_t pending_ = 0;          // words in positions_ that are not stored yet
};

}  // namespace

LevelExtent merge_hash_group(const MergeContext& context, const LevelTask& task, uint64_t hash,
                             uint64_t first_position, uint64_t bytes) {
  GroupFile group(context, task, hash, bytes);
  group.fill();
  task.memory.release();
  const auto runs = group.runs();

  OrderedRowWriter out(task.output, task.format, first_position, context.budget);
  // Words in each run's buffer: a quarter for positions, the other words for rows. The number is a
  // multiple of 8. So the quarter has an even number of words, and no two-word position is cut.
  const size_t each =
      std::clamp<uint64_t>(bytes / 2 / sizeof(uint32_t) / runs.size(), 128, 16384) / 8 * 8;
  PageBuffer<uint32_t> buffers(context.budget, each * runs.size() + kMaxRowWords,
                               "a group of equal hashes");
  std::vector<GroupCursor> cursors;
  for (size_t i = 0; i < runs.size(); ++i) {
    const std::span<uint32_t> mine(buffers.data() + i * each, each);
    cursors.emplace_back(group.file(), runs[i], task.format, hash, task.maps,
                         mine.subspan(each / 4), mine.first(each / 4));
  }
  uint64_t rows = 0;
  merge_cursors(task.format, std::span(cursors), [&](size_t cursor, const RowKey& row) {
    cursors[cursor].set_position(out.add(row));
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
