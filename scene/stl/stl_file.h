// An open STL file and its number of triangles. One pass over an ASCII file also records the
// position of every n-th polygon in the file (block_index.h).
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/warning.h"
#include "core/io/file_system.h"
#include "scene/indexed/block_index.h"
#include "scene/stl/stl_format.h"
#include "voxdag/cancel_token.h"

namespace voxdag::stl {

class StlFile {
 public:
  // Throws Error{kInvalidInput} for a file that is cut off, Error{kLimit} for a line that is too
  // long, and Error{kOutOfMemory} if the budget is too small.
  StlFile(std::unique_ptr<ReadableFile> file, MemoryBudget& budget, const CancelToken& cancel);

  // A polygon of an ASCII file: the position of the word "vertex" of its first vertex, and the
  // number of its first triangle.
  struct PolygonPlace {
    uint64_t offset, line;
    uint64_t first_triangle;
  };

  const ReadableFile& file() const { return *file_; }
  bool is_ascii() const { return format_ == Format::kAscii; }
  uint64_t triangles() const { return triangles_; }
  const BlockIndex<PolygonPlace>& polygon_index() const { return polygon_index_; }
  const std::vector<Warning>& warnings() const { return warnings_.list(); }

 private:
  void count_facets();
  void scan_text(MemoryBudget& budget, const CancelToken& cancel);

  const std::unique_ptr<ReadableFile> file_;
  const Format format_;
  uint64_t triangles_ = 0;
  BlockIndex<PolygonPlace> polygon_index_;
  WarningList warnings_;
};

}  // namespace voxdag::stl
