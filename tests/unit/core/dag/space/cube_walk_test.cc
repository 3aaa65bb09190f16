// Compares the results of cube_walk.h with a direct search. For each voxel, the direct search reads
// all voxels of a window (window_grid()).
#include "core/dag/space/cube_walk.h"

#include <gtest/gtest.h>

#include <memory>

#include "tests/unit/core/dag/space/space_dag.h"

namespace voxdag {
namespace {

using CubeFilter = NodeRef (*)(PooledMemory&, const CubeNeighbors&, int, uint32_t, SubDagTables&);

// Returns, for each voxel v of the octant at `low`, 1 if a voxel of `grid` with the value `value`
// is in the window that extends from v to v + step * radius along each axis.
SpaceGrid window_grid(const SpaceGrid& grid, const SpaceCell& low, int step, int radius,
                      uint8_t value) {
  SpaceGrid found = grid;
  for (uint8_t& voxel : found.voxels) voxel = voxel == value;
  for (int a = 0; a < 3; ++a) {
    const SpaceGrid before = found;
    found.for_each([&](const SpaceCell& c) {
      SpaceCell at = c;
      for (int i = 0; i <= radius && before.has(at); ++i, at[a] += step)
        if (before.at(at)) found.at(c) = 1;
    });
  }
  SpaceGrid out(grid.size[0] / 2);
  out.for_each([&](const SpaceCell& c) {
    out.at(c) = found.at({low[0] + c[0], low[1] + c[1], low[2] + c[2]});
  });
  return out;
}

// Applies add_blocked() or add_enclosed() to one octant of a grid. The other seven octants are its
// neighbors. If `is_divided` is true, each octant is the root of a separate DAG. Otherwise all
// octants are nodes of one DAG of the complete grid.
class FilteredOctant {
 public:
  FilteredOctant(const SpaceGrid& grid, bool is_divided) : whole_(grid) {
    const int edge = grid.size[0] / 2;
    for (int o = 0; o < 8; ++o) {
      SpaceGrid part(edge);
      part.for_each([&](const SpaceCell& c) {
        part.at(c) =
            grid.at({c[0] + (o >> 2) * edge, c[1] + (o >> 1 & 1) * edge, c[2] + (o & 1) * edge});
      });
      parts_[o] = std::make_unique<SpaceDag>(part);
      if (is_divided)
        places_[o] = {&parts_[o]->levels(), 0, 0};
      else if (whole_.levels().has_child(0, 0, o))
        places_[o] = {&whole_.levels(), 1, whole_.levels().child(0, 0, o)};
    }
  }

  // Applies `apply` to octant `first`, whose neighbor n is octant first ^ n. Returns the voxels of
  // the result.
  SpaceGrid filter(int first, uint32_t radius, CubeFilter apply) {
    CubeNeighbors around;
    for (int n = 0; n < 8; ++n) around[static_cast<size_t>(n)] = places_[first ^ n];
    return parts_[0]->filled([&](SubDagTables& tables) {
      apply(tables.memory(), around, tables.size_log2(), radius, tables);
    });
  }

 private:
  SpaceDag whole_;
  std::unique_ptr<SpaceDag> parts_[8];
  NodePlace places_[8];
};

TEST(CubeWalk, EqualsWindowsOfVoxels) {
  std::mt19937 engine(3);
  for (const int radius : {1, 3, 4, 5, 16})
    for (const bool is_divided : {false, true}) {
      SCOPED_TRACE(testing::Message() << "radius " << radius << ", divided " << is_divided);
      const int edge = radius == 5 ? 64 : 32, half = edge / 2;
      // `few` has few voxels, so that some windows are empty, and `many` has few empty voxels, so
      // that some windows are full.
      SpaceGrid few(edge), many(edge);
      const unsigned one_in = static_cast<unsigned>((radius + 1) * (radius + 1) * (radius + 1));
      few.for_each([&](const SpaceCell& c) {
        few.at(c) = engine() % one_in == 0;
        many.at(c) = engine() % one_in != 0;
      });
      few.at({half - 1, half - 1, half - 1}) = many.at({half, half, half}) = 1;
      EXPECT_EQ(FilteredOctant(few, is_divided)
                    .filter(0, static_cast<uint32_t>(radius), add_blocked)
                    .voxels,
                window_grid(few, {0, 0, 0}, 1, radius, 1).voxels);
      SpaceGrid expected = window_grid(many, {half, half, half}, -1, radius, 0);
      for (uint8_t& voxel : expected.voxels) voxel = voxel == 0;
      EXPECT_EQ(FilteredOctant(many, is_divided)
                    .filter(7, static_cast<uint32_t>(radius), add_enclosed)
                    .voxels,
                expected.voxels);
    }
}

// Only the octants near the cube are read from a neighbor.
TEST(CubeWalk, OctantsNear) {
  EXPECT_EQ(octants_near(0, true), 0xff);
  EXPECT_EQ(octants_near(4, true), 0x0f);
  EXPECT_EQ(octants_near(4, false), 0xf0);
  EXPECT_EQ(octants_near(7, true), 0x01);
  EXPECT_EQ(octants_near(7, false), 0x80);
  EXPECT_EQ(smallest_filtered(1), 2);
  EXPECT_EQ(smallest_filtered(4), 2);
  EXPECT_EQ(smallest_filtered(5), 3);
  EXPECT_EQ(smallest_filtered(16), 4);
}

}  // namespace
}  // namespace voxdag
