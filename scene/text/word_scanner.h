// Reads the lines of a text file word by word, such as the rows of an ASCII PLY file. Blank lines,
// and end marks (characters.h) at the end of the file, are skipped. Not thread-safe.
#pragma once

#include <cstdint>
#include <string_view>

#include "scene/text/file_window.h"

namespace voxdag {

class WordScanner {
 public:
  // The file must outlive the scanner.
  WordScanner(const ReadableFile& file, MemoryBudget& budget) : window_(file, budget) {}

  // Moves to the line at `offset` or, if this line is blank, to the next line with text.
  void begin_row(uint64_t offset);
  // Returns the next word of the line, valid until the next call; empty at the end of the line.
  std::string_view word();
  // Moves past blanks and the line end, and returns true. Returns false if a word comes first.
  bool end_row();
  uint64_t offset() const { return offset_; }

 private:
  char peek();
  void skip_blanks();
  std::string_view word_before_marks(std::string_view word);
  std::string_view text_at(uint64_t offset);
  bool is_at_end();

  FileWindow window_;
  uint64_t offset_ = 0;
};

}  // namespace voxdag
