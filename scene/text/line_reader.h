// Reads the lines of a text file from front to back, with jumps, through one window. A line ends
// with LF, CR LF or CR; the last one may have no end. A byte order mark of UTF-8 at the beginning
// of the file is skipped, and so are end marks (characters.h) at the end of the file. Not
// thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/io/file_system.h"

namespace voxdag {

class LineReader {
 public:
  // Maximum size in bytes of a line, joined lines included. A longer comment is skipped.
  static constexpr size_t kMaxLineBytes = size_t{1} << 20;

  // kBackslash: a line that ends with a backslash is joined with the next line, unless the
  // backslash is in a comment. A comment begins with "#", at the beginning of a line or after a
  // blank.
  enum class Join { kNone, kBackslash };

  // The file and the budget must outlive the reader.
  LineReader(const ReadableFile& file, MemoryBudget& budget, Join join);

  // Moves to the line that begins at `offset`, whose number is `number`.
  void seek(uint64_t offset, uint64_t number);
  // Reads the next line. Returns false at the end of the file. Throws Error{kLimit} for a line of
  // over kMaxLineBytes, unless it is a comment.
  bool next();
  // Return the line that next() read: its text without line end, valid until the next call; the
  // offset of its first byte; and its number, which counts from 1.
  std::string_view text() const { return text_; }
  uint64_t offset() const { return base_ + line_; }
  uint64_t number() const { return number_; }
  // Returns the offset in the file of a part of text().
  uint64_t offset_of(std::string_view part) const {
    return base_ + static_cast<uint64_t>(part.data() - buffer_.data());
  }

 private:
  static constexpr size_t kFirstBytes = size_t{256} << 10;
  static constexpr size_t kUnknown = ~size_t{0};

  struct LineEnd {
    size_t begin, end;  // the range of its bytes in buffer_; empty at the end of the file
  };

  void skip_byte_order_mark();
  LineEnd find_end(size_t from);
  bool load_more();
  void skip_comment();
  bool join(LineEnd end);

  const ReadableFile& file_;
  const Join join_;
  PageBuffer<char> buffer_;
  uint64_t base_ = 0;       // offset of buffer_ in the file
  size_t size_ = 0;         // number of bytes in buffer_
  size_t line_ = 0;         // position of the current line in buffer_
  size_t next_ = 0;         // position of the next line in buffer_
  size_t feed_ = kUnknown;  // the first LF at or after next_, or size_ if there is none
  uint64_t number_ = 0, next_number_ = 1;
  std::string_view text_;
};

}  // namespace voxdag
