#include "scheduler/solid/row_sums.h"

#include "core/geometry/overlap.h"

namespace voxdag {

SampleRows sample_rows_of(const Cube& cube, uint32_t grid_levels) {
  const int64_t edge = cube.edge_voxels(grid_levels);
  SampleRows rows{{0, 0, 0},
                  sample_pitch_log2(grid_levels),
                  static_cast<int>(edge >> solid_block_log2(grid_levels))};
  for (int a = 0; a < 3; ++a) rows.low[a] = cube.position[a] * edge * kUnitsPerVoxel;
  return rows;
}

uint64_t rows_per_axis(const Cube& cube, uint32_t grid_levels) {
  const auto side =
      static_cast<uint64_t>(cube.edge_voxels(grid_levels) >> solid_block_log2(grid_levels)) + 1;
  return side * side;
}

RowSums::RowSums(const Cube& cube, uint32_t grid_levels, MemoryBudget& budget)
    : rows_(sample_rows_of(cube, grid_levels)),
      edge_(cube.edge_voxels(grid_levels) * kUnitsPerVoxel),
      charge_(budget, row_bytes(cube, grid_levels), "the sample rows of a solid") {
  for (auto& numbers : numbers_) numbers.assign(rows_per_axis(cube, grid_levels), 0);
}

void RowSums::add(const FixedTriangle& triangle) {
  is_occupied_ = is_occupied_ || triangle_touches_cube(triangle, rows_.low, edge_);
  for (int a = 0; a < 3; ++a) {
    if (triangle.high(a) < rows_.low[a] || triangle.low(a) > rows_.low[a] + edge_) continue;
    rows_.for_each_crossing(triangle, a, [&](int i, int j, int64_t block, int sign) {
      if (block < 0 || block >= rows_.blocks) return;
      add_crossing(numbers_[a][rows_.index(i, j)], sign);
    });
  }
}

}  // namespace voxdag
