// The voxels in which a triangle is visible, as patches: triangles that together touch exactly
// these voxels. A patch is a degenerate triangle along an axis, or half of a rectangle in a layer
// of voxels. Its corners are inside voxels, so that no patch touches a voxel in which the triangle
// is not visible.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "core/color/cutouts/visible_part.h"
#include "core/color/patches/touched_voxels.h"
#include "core/geometry/fixed_triangle.h"

namespace voxdag {

// Divides one triangle after another into patches, and reuses its memory. For one thread.
class VisiblePatches {
 public:
  // Memory that an object allocates.
  static constexpr uint64_t kBytes = 64 * 64 * sizeof(uint64_t);
  // Receives a patch. Returns false to stop.
  using Visit = std::function<bool(const FixedTriangle& patch)>;

  explicit VisiblePatches(uint32_t grid_levels);
  // Visits the patches in an order that depends only on the triangle. Returns false if `visit`
  // returned false.
  bool for_each(const VisiblePart& part, const Visit& visit);

 private:
  // Voxels are collected in blocks of 64^3.
  static constexpr uint32_t kBlockLevels = 6;
  static constexpr size_t kBlockEdge = size_t{1} << kBlockLevels;
  using Voxel = std::array<int64_t, 3>;
  // The axis along the rows, the other axis of the rectangles, and the axis across the layers.
  struct Axes {
    size_t along, aside, across;
  };
  struct Source {
    const VisiblePart& part;
    const TouchedVoxels touched;
    const Visit& visit;
  };

  static Axes axes_of(const FixedTriangle& triangle);
  bool descend(const Source& source, const Cube& cube, bool is_visible);
  void mark_visible(const Source& source, const Cube& cube, bool is_visible);
  void mark(const Voxel& voxel);
  bool visit_rows(const Voxel& low, const Visit& visit);
  bool visit_run(const Voxel& low, size_t row, const Visit& visit);

  const uint32_t grid_levels_, block_level_;
  Axes axes_{};
  // The visible voxels of a block. There is one word for each position across (slowest) and aside,
  // with one bit for each position along axes_.along. All words are 0 between two blocks.
  std::vector<uint64_t> rows_;
  size_t first_row_ = kBlockEdge * kBlockEdge, last_row_ = 0;  // range of the rows that are not 0
};

}  // namespace voxdag
