// The crossings of a cube's triangles with its sample rows (core/geometry/solid_rule.h).
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/geometry/cube.h"
#include "core/geometry/row_crossings.h"

namespace voxdag {

// Returns the sample rows of a cube. Their `low` is the cube's low corner, in lattice units (1/256
// voxel).
SampleRows sample_rows_of(const Cube& cube, uint32_t grid_levels);
// Returns the number of a cube's sample rows along one axis, including the rows on its faces.
uint64_t rows_per_axis(const Cube& cube, uint32_t grid_levels);
// Bytes of one int32_t for each sample row of a cube, along all three axes.
inline uint64_t row_bytes(const Cube& cube, uint32_t grid_levels) {
  return 3 * rows_per_axis(cube, grid_levels) * sizeof(int32_t);
}

// Returns row_bytes() of a cube with this edge in voxels, in a grid of at least 8^3 voxels.
constexpr uint64_t solid_row_bytes(int64_t edge) {
  const auto side = static_cast<uint64_t>(edge / 8 + 1);
  return 3 * side * side * sizeof(int32_t);
}

// A sample row's `number` encodes its crossings: twice the sum of their signs, plus 1 if the row
// has a crossing.
constexpr int32_t row_sum(int32_t number) { return number >> 1; }
constexpr bool has_crossing(int32_t number) { return (number & 1) != 0; }
inline void add_crossing(int32_t& number, int sign) { number = (number + 2 * sign) | 1; }

// Adds up, for each sample row of a cube, the row's crossings with triangles inside the cube. Not
// thread-safe.
class RowSums {
 public:
  // Charges row_bytes() to the budget.
  RowSums(const Cube& cube, uint32_t grid_levels, MemoryBudget& budget);
  void add(const FixedTriangle& triangle);
  const std::vector<int32_t>& numbers(int axis) const { return numbers_[axis]; }
  // True if a triangle touches the cube.
  bool is_occupied() const { return is_occupied_; }

 private:
  const SampleRows rows_;
  const int64_t edge_;  // the cube's edge in lattice units
  const MemoryCharge charge_;
  std::vector<int32_t> numbers_[3];
  bool is_occupied_ = false;
};

}  // namespace voxdag
