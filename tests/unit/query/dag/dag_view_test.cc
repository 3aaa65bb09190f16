#include "query/dag/dag_view.h"

#include <gtest/gtest.h>

#include <set>

#include "tests/unit/query/voxel_scene.h"

using namespace voxdag::query;

namespace {

// for_each_cell() at the finest level visits each voxel once, with its position. It does not visit
// children that the selection function excludes.
TEST(DagView, VisitsTheSelectedCells) {
  const std::set<VoxelScene::Voxel> voxels = {{3, 9, 30}, {20, 10, 1}, {4, 4, 4}, {31, 31, 31}};
  const VoxelScene scene(5, voxels);
  const DagView dag = scene.view();
  std::multiset<VoxelScene::Voxel> seen;
  const auto add = [&](const DagView::Cell& cell) {
    EXPECT_EQ(cell.edge, 1);
    seen.insert({static_cast<int64_t>(cell.low[0]), static_cast<int64_t>(cell.low[1]),
                 static_cast<int64_t>(cell.low[2])});
  };
  dag.for_each_cell(
      5, [](const DagView::Cell&) { return 0xffu; }, add);
  EXPECT_EQ(seen, std::multiset<VoxelScene::Voxel>(voxels.begin(), voxels.end()));
  seen.clear();
  // Excludes the four children of the root with x < 16.
  dag.for_each_cell(
      5, [](const DagView::Cell& c) { return c.depth == 0 ? 0xf0u : 0xffu; }, add);
  EXPECT_EQ(seen, (std::multiset<VoxelScene::Voxel>{{20, 10, 1}, {31, 31, 31}}));
}

}  // namespace
