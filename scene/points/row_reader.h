// Reads the rows of a text file with points: its lines, except blank lines and comments. A comment
// begins with # or //. Not thread-safe.
#pragma once

#include <cstdint>
#include <string_view>

#include "scene/text/characters.h"
#include "scene/text/line_reader.h"

namespace voxdag::points {

// True if a line, without blanks around it, is empty or a comment.
inline bool is_comment(std::string_view line) {
  return line.empty() || line.front() == '#' || line.starts_with("//");
}

class RowReader {
 public:
  // The place of a row: the offset of its line in the file, and the line's number, from 1.
  struct Place {
    uint64_t offset = 0;
    uint64_t line = 1;
  };

  // The file must outlive the reader.
  RowReader(const ReadableFile& file, MemoryBudget& budget)
      : lines_(file, budget, LineReader::Join::kNone) {}

  // Continues at `place`, which must be the beginning of a line.
  void seek(const Place& place) { lines_.seek(place.offset, place.line); }
  // Reads the next row. Returns false at the end of the file. Throws Error{kLimit} for a line that
  // is too long.
  bool next() {
    do {
      if (!lines_.next()) return false;
      text_ = trimmed(lines_.text());
    } while (is_comment(text_));
    return true;
  }
  // Returns the text of the row, without blanks around it. Valid until the next call of next().
  std::string_view text() const { return text_; }
  Place place() const { return {lines_.offset(), lines_.number()}; }

 private:
  LineReader lines_;
  std::string_view text_;
};

}  // namespace voxdag::points
