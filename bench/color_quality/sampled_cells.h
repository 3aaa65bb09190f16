// A sample of the colored cells of a file, and a search for the sampled cells near a triangle.
#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/format/global/voxdag_reader.h"
#include "core/geometry/fixed_triangle.h"

namespace voxdag {

using CellPosition = std::array<uint32_t, 3>;

class SampledCells {
 public:
  // Selects about `wanted` of the file's colored cells by a hash of their positions. So two files
  // with the same cells have the same sample. The file must have colors.
  SampledCells(const voxdag_reader::File& file, uint64_t wanted);

  // Returns the positions of the sampled cells, in Morton order.
  const std::vector<CellPosition>& positions() const { return positions_; }
  // Number of colored cells on the file's finest color level.
  uint64_t file_cells() const { return file_cells_; }
  // log2 of a cell's edge in lattice units (1/256 voxel).
  int cell_bits() const { return cell_bits_; }
  // Appends the indices (in positions()) of all sampled cells that the triangle touches. Also
  // appends some cells that are near the triangle and do not touch it.
  void find_near(const FixedTriangle& triangle, std::vector<uint32_t>& cells) const;

 private:
  struct Plane;
  void descend(const Plane& plane, const FixedTriangle& triangle, uint32_t level, CellPosition low,
               size_t first, size_t last, std::vector<uint32_t>& cells) const;

  uint32_t color_levels_;
  int cell_bits_;
  uint64_t file_cells_ = 0;
  std::vector<CellPosition> positions_;
  std::vector<uint64_t> codes_;
};

}  // namespace voxdag
