// Reads the triangles of an STL file, starting at any of them. Not thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/geometry/fixed_triangle.h"
#include "core/geometry/grid.h"
#include "scene/stl/stl_file.h"

namespace voxdag::stl {

class Facets {
 public:
  virtual ~Facets() = default;
  // Writes triangles [first, first + count) to `out`. The triangles must exist; their coordinates
  // can be NaN or infinite.
  virtual void read(uint64_t first, size_t count, WorldTriangle* out) = 0;
  // Returns the attributes of the triangles of the last read(); empty if the file has none.
  const std::vector<uint16_t>& attributes() const { return attributes_; }
  // Returns the place of a triangle in the file, for messages.
  virtual std::string place_of(uint64_t triangle) = 0;

 protected:
  std::vector<uint16_t> attributes_;
};

// The file must outlive the facets.
std::unique_ptr<Facets> open_facets(const StlFile& stl, MemoryBudget& budget);

}  // namespace voxdag::stl
