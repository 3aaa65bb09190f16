// The voxels of a cube that a triangle touches. Exact, and faster than a descent of the octree.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>

#include "core/base/integers.h"
#include "core/color/rule/cell_triangle.h"
#include "core/color/rule/touched_cells.h"
#include "core/geometry/fixed_triangle.h"

namespace voxdag {

class TouchedVoxels {
 public:
  explicit TouchedVoxels(const FixedTriangle& triangle) {
    if (color::is_narrow(triangle))
      narrow_.emplace(triangle, kUnitBits);
    else
      wide_.emplace(triangle, kUnitBits);
  }

  // Calls visit(voxel) for each touched voxel of the cube with the low corner `low` and the edge
  // `edge`, in voxels.
  template <class Visit>
  void for_each(const std::array<int64_t, 3>& low, int64_t edge, const Visit& visit) const {
    narrow_ ? for_each_of(*narrow_, low, edge, visit) : for_each_of(*wide_, low, edge, visit);
  }

 private:
  template <class Int, class Visit>
  static void for_each_of(const color::CellTriangle<Int>& triangle,
                          const std::array<int64_t, 3>& low, int64_t edge, const Visit& visit) {
    color::CellRange range;
    size_t axis[3];
    for (int d = 0; d < 3; ++d) {
      axis[d] = static_cast<size_t>(triangle.axis[d]);
      const int64_t first = std::min({triangle.v[0][d], triangle.v[1][d], triangle.v[2][d]});
      const int64_t last = std::max({triangle.v[0][d], triangle.v[1][d], triangle.v[2][d]});
      range.first[d] = std::max(low[axis[d]], first >> kUnitBits);
      range.last[d] = std::min(low[axis[d]] + edge - 1, last >> kUnitBits);
    }
    color::TouchedCells<Int>(triangle, range).visit([&](int64_t p, int64_t q, int64_t r, uint32_t) {
      std::array<int64_t, 3> voxel;
      voxel[axis[0]] = p;
      voxel[axis[1]] = q;
      voxel[axis[2]] = r;
      visit(voxel);
    });
  }

  std::optional<color::CellTriangle<int64_t>> narrow_;
  std::optional<color::CellTriangle<int128>> wide_;
};

}  // namespace voxdag
