// A queue of words in a scratch file. All words are written first, and then all are read in the
// same order.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "merge/load/scratch_file.h"

namespace voxdag::query {

inline constexpr uint64_t kQueueBufferWords = uint64_t{1} << 15;

class WordQueue {
 public:
  WordQueue(ScratchFolder& folder, MemoryBudget& budget)
      : file_(folder), buffer_(budget, kQueueBufferWords, "a queue of nodes") {}

  uint64_t words() const { return written_ + count_; }
  void add(std::span<const uint32_t> words) {
    if (count_ + words.size() > kQueueBufferWords) flush();
    std::ranges::copy(words, buffer_.data() + count_);
    count_ += words.size();
  }
  // Writes the remaining words to the file. Must be called after the last add() and before the
  // queue is read.
  void finish() {
    flush();
    buffer_ = {};
  }

 private:
  friend class WordQueueReader;
  void flush() {
    if (count_ > 0) file_.write(written_, {buffer_.data(), count_});
    written_ += count_;
    count_ = 0;
  }

  ScratchFile file_;
  PageBuffer<uint32_t> buffer_;
  uint64_t count_ = 0;    // words in the buffer
  uint64_t written_ = 0;  // words in the file
};

// Reads a queue from its beginning. The queue must be finished and outlive the reader.
class WordQueueReader {
 public:
  WordQueueReader(const WordQueue& queue, MemoryBudget& budget)
      : queue_(queue), buffer_(budget, 2 * kQueueBufferWords, "a queue of nodes") {}

  bool at_end() const { return at_ == count_ && loaded_ == queue_.words(); }
  // Returns the next words: `count` words, or fewer at the end of the queue. skip() moves past
  // them. `count` must be at most kQueueBufferWords. The result is valid until the next call.
  std::span<const uint32_t> peek(uint64_t count) {
    if (count_ - at_ < count && loaded_ < queue_.words()) load();
    return {buffer_.data() + at_, std::min(count, count_ - at_)};
  }
  void skip(uint64_t count) { at_ += count; }

 private:
  void load() {
    std::copy(buffer_.data() + at_, buffer_.data() + count_, buffer_.data());
    count_ -= at_;
    at_ = 0;
    const uint64_t more = std::min(kQueueBufferWords, queue_.words() - loaded_);
    queue_.file_.read(loaded_, {buffer_.data() + count_, more});
    loaded_ += more;
    count_ += more;
  }

  const WordQueue& queue_;
  PageBuffer<uint32_t> buffer_;
  uint64_t at_ = 0;      // position in the buffer
  uint64_t count_ = 0;   // words in the buffer
  uint64_t loaded_ = 0;  // words of the file that were read into the buffer
};

}  // namespace voxdag::query
