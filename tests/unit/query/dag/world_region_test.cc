// Tests the conversion of boxes and points from world space to cells.
#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "core/format/global/open_global.h"
#include "query/dag/selection.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/query/export/corners.h"

namespace voxdag::query {
namespace {

// A grid whose edge and low corner are not round numbers, as in real scenes.
class WorldRegion : public testing::Test {
 protected:
  static constexpr uint32_t kLevels = 17;
  static constexpr int64_t kEdge = int64_t{1} << kLevels;
  WorldRegion() {
    write_corners(folder_.file("a.vdag"),
                  Grid::given({-1920.9469616, -126.4427185, -1861.3}, 3720.9632874, kLevels));
    file_ = open_global_file(folder_.file("a.vdag"));
  }
  // Computes a world coordinate like to_world() of the Python package.
  double world(size_t axis, double cells) const {
    return file_->origin()[axis] + cells * (file_->edge() / static_cast<double>(kEdge));
  }
  int64_t cell(size_t axis, double at) const { return world_to_cell(*file_, kLevels, axis, at); }

  TemporaryFolder folder_;
  std::unique_ptr<voxdag_reader::File> file_;
};

// The low corner of a cell belongs to this cell, although its world coordinates are rounded
// doubles. A box that ends at this corner does not contain the cell.
TEST_F(WorldRegion, CornersOfCellsAreExact) {
  std::mt19937 random(5);
  const auto number = [&] { return static_cast<int64_t>(random() % kEdge); };
  for (int i = 0; i < 20000; ++i) {
    Region region;
    std::array<double, 6> box{};
    for (size_t axis = 0; axis < 3; ++axis) {
      region.low[axis] = number();
      region.high[axis] = region.low[axis] + 1 + number();
      box[axis] = world(axis, static_cast<double>(region.low[axis]));
      box[axis + 3] = world(axis, static_cast<double>(region.high[axis]));
      ASSERT_EQ(cell(axis, box[axis]), region.low[axis]);
      ASSERT_EQ(cell(axis, world(axis, static_cast<double>(region.low[axis]) + 0.5)),
                region.low[axis]);
    }
    ASSERT_EQ(world_to_region(*file_, kLevels, box), region);
  }
}

// The tolerance for corners is small: a coordinate that is 1e-6 cells away from a cell's boundary
// is not moved to it.
TEST_F(WorldRegion, OtherPlacesStay) {
  for (const double part : {1e-6, 0.001, 0.25}) {
    EXPECT_EQ(cell(0, world(0, 1000 - part)), 999);
    EXPECT_EQ(cell(0, world(0, 1000 + part)), 1000);
    const Region region = world_to_region(*file_, kLevels,
                                          {world(0, 10 + part), world(1, 10 - part), world(2, 10),
                                           world(0, 20 + part), world(1, 20 - part), world(2, 20)});
    EXPECT_EQ(region, (Region{{10, 9, 10}, {21, 20, 20}}));
  }
}

TEST_F(WorldRegion, MayBeInfinite) {
  const double infinite = std::numeric_limits<double>::infinity();
  const std::array<double, 6> half = {-infinite, world(1, 7), -infinite,
                                      infinite,  infinite,    world(2, 9)};
  EXPECT_EQ(world_to_region(*file_, kLevels, half), (Region{{0, 7, 0}, {kEdge, kEdge, 9}}));
  EXPECT_EQ(world_to_region(*file_, 3, half), (Region{{0, 0, 0}, {8, 8, 1}}));
  const Region far = world_to_region(*file_, kLevels, {-1e300, -1, -1, 1e300, 1, 1});
  EXPECT_EQ(far.low[0], -(int64_t{1} << 62));
  EXPECT_EQ(cut_to_grid(far, kLevels).high[0], kEdge);
}

}  // namespace
}  // namespace voxdag::query
