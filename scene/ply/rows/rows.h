// Reads the rows of one element of a PLY file, one after another. Returns the values of the
// requested properties and skips all others. Not thread-safe.
//
// In an ASCII file, the values of a row are separated by blanks or line ends. A row is usually a
// line, but it may also be several lines or a part of a line.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/io/file_system.h"
#include "scene/ply/rows/header.h"

namespace voxdag::ply {

// Properties of an element, by index.
struct RequestedProperties {
  static constexpr size_t kNone = ~size_t{0};

  size_t indices = kNone;       // a list of integers: vertex indices
  size_t reals = kNone;         // a list of numbers
  std::vector<size_t> numbers;  // properties that are not lists
};

class Rows {
 public:
  // Maximum number of corners. A corner is one entry of the list of indices, and two entries of the
  // list of reals.
  static constexpr uint64_t kMaxEntries = 32768;

  virtual ~Rows() = default;
  // Reads the row at `offset` and returns the offset after it. `row` is the row's number, for
  // messages. Throws Error{kInvalidInput} with element and row if the row is invalid or ends past
  // the file. Throws Error{kLimit} if a requested list is too long.
  virtual uint64_t read(uint64_t row, uint64_t offset) = 0;

  // Return the requested values of the last row. An index that is negative or needs more than 32
  // bits is kNoVertex.
  std::span<const uint32_t> indices() const { return {indices_.data(), index_count_}; }
  std::span<const double> reals() const { return {reals_.data(), real_count_}; }
  std::span<const double> numbers() const { return numbers_; }

  // Returns the first row that is not exactly one line of an ASCII file, for messages; "" if all
  // rows are lines.
  const std::string& first_irregular() const { return first_irregular_; }

 protected:
  Rows(const ReadableFile& file, const Element& element, const RequestedProperties& requested,
       MemoryBudget& budget);
  // Returns the position of a property in numbers(), or kNone.
  size_t number_of(size_t property) const;
  // Returns `count`, the number of entries of a list. Throws Error if it is negative, larger than
  // the file's size in bytes, or above the limit of a requested list.
  uint64_t checked_count(int64_t count, uint64_t row, size_t property) const;
  [[noreturn]] void refuse(uint64_t row, const std::string& what) const;

  const ReadableFile& file_;
  const Element& element_;
  const RequestedProperties requested_;
  PageBuffer<uint32_t> indices_;
  PageBuffer<double> reals_;
  std::vector<double> numbers_;
  size_t index_count_ = 0, real_count_ = 0;
  std::string first_irregular_;
};

// Returns a reader of the rows of `element`. `file` and `element` must outlive it.
std::unique_ptr<Rows> open_rows(const ReadableFile& file, Format format, const Element& element,
                                const RequestedProperties& requested, MemoryBudget& budget);
std::unique_ptr<Rows> open_ascii_rows(const ReadableFile& file, const Element& element,
                                      const RequestedProperties& requested, MemoryBudget& budget);

}  // namespace voxdag::ply
