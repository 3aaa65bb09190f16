// Full cubes, as in solids, take little memory and file size: formats that store trees have one
// tile for a full cube, and exports of surfaces visit only its sides.
#include <gtest/gtest.h>

#include <bit>
#include <set>

#include "core/format/global/open_global.h"
#include "query/export/export.h"
#include "query/lookup/bricks.h"
#include "tests/unit/core/format/test_files.h"

namespace voxdag::query {
namespace {

class ExportTiles : public testing::Test {
 protected:
  // Returns a ball, scattered voxels, and two cubes, one of which has a hole.
  static oracle::Voxels solid() {
    oracle::Voxels voxels = random_voxels(9, 64);
    for (int x = 0; x < 64; ++x)
      for (int y = 0; y < 64; ++y)
        for (int z = 0; z < 64; ++z) {
          const bool ball = (x - 20) * (x - 20) + (y - 20) * (y - 20) + (z - 24) * (z - 24) < 400;
          const bool cubes = x >= 32 && y >= 32 && !(x == 37 && y == 50 && z == 11);
          if (ball || cubes) voxels.set(x, y, z);
        }
    return voxels;
  }
  std::unique_ptr<voxdag_reader::File> open(const oracle::Voxels& voxels) {
    write_global(folder_.file("a.vdag"), voxels);
    return open_global_file(folder_.file("a.vdag"));
  }
  ExportReport exported(const voxdag_reader::File& file, const std::string& format,
                        uint64_t memory_bytes) {
    NoProgress progress;
    return export_dag(system_files(), file,
                      {&export_format(format),
                       {file.grid_levels(), whole_grid(file.grid_levels())},
                       folder_.file("out"),
                       memory_bytes,
                       false,
                       true},
                      progress, CancelToken{});
  }

  TemporaryFolder folder_;
};

using Cell = std::array<int64_t, 3>;

// for_each_brick_or_full_cube() visits the same cells as for_each_brick(), each cell once. The full
// cubes that it visits are aligned, and no full cube is part of a larger full cube.
TEST_F(ExportTiles, BricksAndFullCubesAreAllCells) {
  const auto file = open(solid());
  const DagView dag(*file);
  for (const Selection& selection :
       {Selection{6, whole_grid(6)}, Selection{5, whole_grid(5)}, Selection{3, whole_grid(3)},
        Selection{6, {{5, 0, 9}, {60, 64, 57}}}, Selection{5, {{1, 2, 3}, {32, 30, 31}}}}) {
    SCOPED_TRACE(selection.grid_levels);
    std::set<Cell> expected, found;
    for_each_brick(dag, selection, [&](const Brick& brick) {
      for_each_cell_of(brick, [&](const Position& cell) { expected.insert(cell); });
    });
    uint64_t cubes = 0;
    const auto add_cube = [&](const Position& low, int64_t edge) {
      ++cubes;
      EXPECT_GE(edge, 8);
      EXPECT_EQ((low[0] | low[1] | low[2]) % edge, 0);
      for (int64_t x = low[0]; x < low[0] + edge; ++x)
        for (int64_t y = low[1]; y < low[1] + edge; ++y)
          for (int64_t z = low[2]; z < low[2] + edge; ++z)
            EXPECT_TRUE(found.insert({x, y, z}).second);
    };
    for_each_brick_or_full_cube(
        dag, selection,
        [&](const Brick& brick) {
          for_each_cell_of(brick,
                           [&](const Position& cell) { EXPECT_TRUE(found.insert(cell).second); });
        },
        add_cube);
    EXPECT_TRUE(found == expected);
    EXPECT_EQ(cubes > 0, selection.grid_levels > 3);  // with 8 cells per edge, no cube is full
  }
}

TEST_F(ExportTiles, FullGridsTakeLittle) {
  oracle::Voxels full(128);
  for (int x = 0; x < 128; ++x)
    for (int y = 0; y < 128; ++y)
      for (int z = 0; z < 128; ++z) full.set(x, y, z);
  const auto file = open(full);
  const uint64_t voxels = uint64_t{128} * 128 * 128;
  for (const ExportFormat& format : export_formats()) {
    const std::string name = format.name;
    if (name != "bt" && name != "vdb" && name != "nvdb" && name != "glb") continue;
    SCOPED_TRACE(name);
    const ExportReport report = exported(*file, name, uint64_t{2} << 20);
    EXPECT_EQ(report.voxels, voxels);
    EXPECT_LT(report.bytes, uint64_t{1} << 20);
    if (name == "glb") {
      EXPECT_EQ(report.notes[0], "6 rectangles, 12 triangles, 8 vertices");
    }
  }
}

}  // namespace
}  // namespace voxdag::query
