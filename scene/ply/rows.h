// Reads the rows of one element of a PLY file, one after another. Returns the entries of one list
// property, the wanted list, which holds the corners of faces. Skips all other properties. Not
// thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/io/file_system.h"
#include "scene/ply/header.h"

namespace voxdag::ply {

class Rows {
 public:
  // Maximum number of entries in the wanted list.
  static constexpr uint64_t kMaxEntries = 32768;
  static constexpr size_t kNoList = ~size_t{0};

  virtual ~Rows() = default;
  // Reads the row at `offset` and returns the offset after it. `row` is its number, for messages.
  // Throws Error{kInvalidInput} with element and row if the row is invalid or ends past the file,
  // Error{kLimit} if the wanted list has more than kMaxEntries entries.
  virtual uint64_t read(uint64_t row, uint64_t offset) = 0;
  // Returns the entries of the wanted list in the last row. A negative index becomes kNoVertex.
  std::span<const uint32_t> entries() const { return {entries_.data(), entry_count_}; }

 protected:
  Rows(const ReadableFile& file, const Element& element, MemoryBudget& budget);
  // Returns the number of entries of a list. Throws Error if it is negative, exceeds the bytes of
  // the file or, for the wanted list, exceeds kMaxEntries.
  uint64_t checked_count(int64_t count, uint64_t row, bool is_wanted) const;
  [[noreturn]] void refuse(uint64_t row, const std::string& what) const;

  const ReadableFile& file_;
  const Element& element_;
  PageBuffer<uint32_t> entries_;
  size_t entry_count_ = 0;
};

// Returns a reader of the rows of `element`. `list` is the index of the wanted list among the
// properties, or kNoList. Its entries must be integers. `file` and `element` must outlive the rows.
std::unique_ptr<Rows> open_rows(const ReadableFile& file, Format format, const Element& element,
                                size_t list, MemoryBudget& budget);

}  // namespace voxdag::ply
