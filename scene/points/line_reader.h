// Reads the lines of a text file, except blank lines and comments. A line ends with LF, CR LF or
// CR. A comment begins with # or //. Not thread-safe.
#pragma once

#include <cstdint>
#include <string_view>

#include "scene/text/file_window.h"

namespace voxdag::points {

class LineReader {
 public:
  static constexpr size_t kMaxLine = size_t{64} << 10;  // bytes

  // The place of a line: its offset in the file, and its number, from 1.
  struct Place {
    uint64_t offset = 0;
    uint64_t line = 1;
  };

  // The file must outlive the reader.
  LineReader(const ReadableFile& file, MemoryBudget& budget) : window_(file, budget) {}

  // Continues at `place`, which must be the beginning of a line.
  void seek(const Place& place) { next_ = place; }
  // Reads the next line that is neither blank nor a comment. Returns false at the end of the file.
  // Throws Error{kLimit} for a line of more than kMaxLine bytes.
  bool next();
  // The text of the line, without its end and blanks around it. Valid until the next call of
  // next().
  std::string_view text() const { return text_; }
  const Place& place() const { return place_; }
  // The place after the line.
  const Place& end() const { return next_; }

 private:
  std::string_view read_line();
  void skip_line_end();
  char at(uint64_t offset);

  FileWindow window_;
  Place place_, next_;
  std::string_view text_;
};

// True if the text, without blanks around it, is empty or a comment.
bool is_comment(std::string_view text);

}  // namespace voxdag::points
