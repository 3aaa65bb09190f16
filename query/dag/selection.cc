#include "query/dag/selection.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "core/base/error.h"
#include "core/dag/brick.h"

namespace voxdag::query {

namespace {

// Maximum distance, in cells, at which a coordinate counts as on a cell boundary. A build moves
// vertices to multiples of 1/256 voxel, so a difference of less than half of this step has no
// meaning.
constexpr double kMaxSnapCells = 1.0 / 512;
// Maximum rounding error of a coordinate, relative to the largest number from which it is computed.
constexpr double kRounding = 4 * std::numeric_limits<double>::epsilon();

int64_t whole_cells(double cells) {
  return static_cast<int64_t>(std::clamp(cells, -0x1p62, 0x1p62));
}

}  // namespace

double world_to_cells(const voxdag_reader::File& file, uint32_t grid_levels, size_t axis,
                      double world) {
  const double origin = file.origin()[axis];
  const double cell_edge = std::ldexp(file.edge(), -static_cast<int>(grid_levels));
  const double cells = (world - origin) / cell_edge;
  const double largest = std::max({std::fabs(world), std::fabs(origin), file.edge()});
  const double boundary = std::round(cells);
  const bool is_on_it =
      std::fabs(cells - boundary) <= std::min(kRounding * largest / cell_edge, kMaxSnapCells);
  return is_on_it ? boundary : cells;
}

int64_t world_to_cell(const voxdag_reader::File& file, uint32_t grid_levels, size_t axis,
                      double world) {
  return whole_cells(std::floor(world_to_cells(file, grid_levels, axis, world)));
}

Region world_to_region(const voxdag_reader::File& file, uint32_t grid_levels,
                       const std::array<double, 6>& box) {
  const auto cells = [&](size_t axis, double world) {
    if (std::isinf(world)) return world < 0 ? 0 : std::ldexp(1, static_cast<int>(grid_levels));
    return world_to_cells(file, grid_levels, axis, world);
  };
  Region region;
  for (size_t axis = 0; axis < 3; ++axis) {
    region.low[axis] = whole_cells(std::floor(cells(axis, box[axis])));
    region.high[axis] = whole_cells(std::ceil(cells(axis, box[axis + 3])));
  }
  return region;
}

void check_grid(const Selection& selection, uint32_t file_levels) {
  if (selection.grid_levels < kBrickLevels || selection.grid_levels > file_levels)
    throw Error(ErrorCode::kInvalidInput,
                "the selected resolution is 2^" + std::to_string(selection.grid_levels) +
                    " voxels per edge: expected 2^" + std::to_string(kBrickLevels) + " to 2^" +
                    std::to_string(file_levels) + ", the resolution of the file");
}

}  // namespace voxdag::query
