// Reads the triangles of the element tristrips of a PLY file. Each row is a list of vertex indices.
// Every three consecutive indices are a triangle. In every second triangle, the first two corners
// are exchanged, so that all triangles have the same orientation. The index -1 begins a new strip.
// The largest number of an unsigned type also begins a strip, if no vertex has this index.
// Triangles with two equal indices only join parts of a strip, and are left out.
//
// A row may have any number of entries, so position() and seek() also work within a row. Not
// thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "scene/ply/rows/header.h"
#include "scene/text/file_window.h"
#include "scene/text/word_scanner.h"

namespace voxdag::ply {

class StripReader {
 public:
  // A position in the element.
  struct Position {
    uint64_t offset = 0;  // offset in the file
    uint64_t row = 0;     // number of rows that have begun
    uint64_t left = 0;    // entries of the row that are not read yet
    uint32_t last[2] = {};
    uint8_t strip_entries = 0;  // number of valid entries in `last`
    bool is_odd = false;        // the next triangle has its first two corners exchanged
  };

  // `list` is the index of the list among the properties of `element`. `vertices` is the number of
  // vertices. `file` and `element` must outlive the reader.
  StripReader(const ReadableFile& file, Format format, const Element& element, size_t list,
              uint64_t vertices, MemoryBudget& budget);

  const Position& position() const { return at_; }
  void seek(const Position& position) { at_ = position; }
  // Reads the next triangle. Returns false after the last one. Throws Error{kInvalidInput} with the
  // row if it is invalid or ends past the file. An index out of range is not an error.
  bool next(uint32_t* corners);
  // Number of the row of the last triangle.
  uint64_t row() const { return at_.row - 1; }

 private:
  void begin_row();
  void skip_properties(size_t begin, size_t end);
  bool next_entry();
  int64_t list_count(const Property& property);
  std::string_view word();
  const std::byte* bytes(size_t size);
  int64_t integer(Type type);
  void skip(Type type, uint64_t count);
  [[noreturn]] void refuse(const std::string& what) const;

  const ReadableFile& file_;
  const Format format_;
  const Element& element_;
  const size_t list_;
  const int64_t restart_;  // the entry besides -1 that begins a strip; -1 if there is none
  std::optional<FileWindow> window_;
  std::optional<WordScanner> text_;
  Position at_;
  uint32_t entry_ = 0;  // the last entry that was read
};

}  // namespace voxdag::ply
