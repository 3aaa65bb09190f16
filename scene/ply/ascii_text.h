// The rows of an ASCII PLY file, word by word: a line each, blank ones aside. Not thread-safe.
#pragma once

#include <cstdint>
#include <string_view>

#include "scene/ply/file_window.h"

namespace voxdag::ply {

class AsciiText {
 public:
  // The file must outlive the text.
  AsciiText(const ReadableFile& file, MemoryBudget& budget) : window_(file, budget) {}

  // Moves to the line at `offset` or, if it is blank, to the next line with text.
  void begin_row(uint64_t offset);
  // The next word of the line, valid until the next call; empty at the end of the line.
  std::string_view word();
  // Whether nothing but blanks is left of the line, which is passed over.
  bool end_row();
  uint64_t offset() const { return offset_; }

 private:
  char peek();
  void skip_blanks();

  FileWindow window_;
  uint64_t offset_ = 0;
};

}  // namespace voxdag::ply
