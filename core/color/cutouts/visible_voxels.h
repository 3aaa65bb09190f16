// The voxels in which a triangle is visible, as segments: degenerate triangles along an axis that
// touch exactly these voxels.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>

#include "core/color/cutouts/visible_part.h"
#include "core/geometry/fixed_triangle.h"

namespace voxdag {

class VisibleVoxels {
 public:
  // Receives a segment. Returns false to stop.
  using Visit = std::function<bool(const FixedTriangle& segment)>;

  // The part must outlive this object.
  VisibleVoxels(const VisiblePart& part, uint32_t grid_levels);
  // Visits the segments in an order that depends only on the triangle. Returns false as soon as
  // `visit` returns false.
  bool for_each_segment(const Visit& visit);

 private:
  // Voxels are collected in blocks of 16^3.
  static constexpr uint32_t kBlockLevels = 4;
  static constexpr int64_t kBlockEdge = int64_t{1} << kBlockLevels;

  bool descend(const Cube& cube, bool is_visible, const Visit& visit);
  void mark(const Cube& cube, bool is_visible);
  bool visit_rows(const std::array<int64_t, 3>& low, const Visit& visit) const;

  const VisiblePart& part_;
  const uint32_t grid_levels_, block_level_;
  size_t along_ = 0;  // axis of the segments
  // The current block: for each position along the other two axes, a row of 16 bits along this
  // axis.
  std::array<uint16_t, kBlockEdge * kBlockEdge> rows_{};
};

}  // namespace voxdag
