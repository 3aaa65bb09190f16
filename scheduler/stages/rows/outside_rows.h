// The crossings of sample rows with triangles outside the grid. A sample row
// (core/geometry/solid_rule.h) is a line that continues beyond the grid. Triangles can be outside
// the grid only if --bounds gives the grid. The row sums of the subvolumes (RowSums) do not count
// crossings outside the grid. Not thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <map>

#include "core/base/memory_budget.h"
#include "core/geometry/row_crossings.h"
#include "scene/triangle_source.h"
#include "scheduler/spec/build_spec.h"
#include "scheduler/stages/rows/row_column.h"

namespace voxdag {

class OutsideRows {
 public:
  // Charges the memory for rows with crossings outside the grid to `budget`. Throws
  // Error{kOutOfMemory}.
  OutsideRows(uint32_t grid_levels, MemoryBudget& budget);
  // Adds all triangles of the scene. Throws Error{kLimit} for a triangle that a sample row can
  // cross and that has a vertex beyond kCoordinateLimit.
  void read(TriangleSource& scene, const Grid& grid, const StageContext& context);
  void add(const FixedTriangle& triangle);

  // Returns the crossings outside the grid of the rows along `axis` that go through a tile or along
  // its border; null if none exist. (`first`, `second`) is the tile's position on the other two
  // axes.
  const OutsideTile* find(int axis, int first, int second) const;
  // Calls visit(axis, first, second, tile) for each tile with a sample row that a triangle crosses
  // outside the grid. The arguments have the same meaning as in find().
  template <class Visit>
  void for_each(Visit visit) const {
    for (const auto& [key, tile] : tiles_) visit(key[0], key[1], key[2], tile);
  }

 private:
  void add(int axis, int i, int j, bool is_before, int sign);

  const TileGrid grid_;
  const SampleRows rows_;  // sample rows of the grid
  MemoryBudget& budget_;
  MemoryCharge charge_;
  std::map<std::array<int, 3>, OutsideTile> tiles_;  // by axis and position
};

}  // namespace voxdag
