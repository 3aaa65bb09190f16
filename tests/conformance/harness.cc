#include "tests/conformance/harness.h"

#include <bit>

#include "core/dag/brick.h"
#include "tests/oracle/check_sub_dag.h"

namespace voxdag {
namespace {

// Stores the received arrays, and checks the order of the calls.
class OrderedSink : public SubDagSink {
 public:
  OrderedSink(Built& built, const SubvolumeTask& task)
      : built_(built), next_level_(task.grid_levels - kBrickLevels) {}
  void bricks(const BrickLevelView& level) override {
    EXPECT_FALSE(built_.sink_called) << "bricks() was called late or twice";
    built_.sink_called = true;
    built_.dag.bricks(level);
  }
  void nodes(const NodeLevelView& level) override {
    EXPECT_TRUE(built_.sink_called) << "nodes() was called before bricks()";
    EXPECT_EQ(level.level, --next_level_);
    built_.dag.nodes(level);
  }

 private:
  Built& built_;
  uint32_t next_level_;
};

// Returns the position of the first child of node `index` of a level array.
size_t first_child(const SubDag::Nodes& nodes, size_t index) {
  size_t at = 0;
  for (size_t i = 0; i < index; ++i) at += static_cast<size_t>(std::popcount(nodes.masks[i]));
  return at;
}

// Sets the voxels of one node in `out`. `levels_above` is the number of levels from the bricks to
// the node.
struct Decoder {
  const SubDag& dag;
  const oracle::Region& region;
  oracle::Voxels& out;

  void node(size_t levels_above, uint32_t index, const Cube& cube, uint32_t grid_levels) const {
    const oracle::Region here = oracle::region_of(cube, grid_levels);
    for (int a = 0; a < 3; ++a)
      if (here.low[a] + here.edge <= region.low[a] || here.low[a] >= region.low[a] + region.edge)
        return;
    if (levels_above == 0) return brick(dag.brick_masks.at(index), here);
    const SubDag::Nodes& nodes = dag.levels.at(levels_above - 1);
    size_t child = first_child(nodes, index);
    for (int c = 0; c < 8; ++c)
      if (nodes.masks.at(index) >> c & 1)
        node(levels_above - 1, nodes.children.at(child++), cube.child(c), grid_levels);
  }

  void brick(uint64_t mask, const oracle::Region& here) const {
    for (int x = 0; x < 4; ++x)
      for (int y = 0; y < 4; ++y)
        for (int z = 0; z < 4; ++z)
          if (mask >> brick_bit(x, y, z) & 1)
            out.set(static_cast<int>(here.low[0] - region.low[0]) + x,
                    static_cast<int>(here.low[1] - region.low[1]) + y,
                    static_cast<int>(here.low[2] - region.low[2]) + z);
  }
};

}  // namespace

Built build(Backend& backend, const SubvolumeTask& task, TriangleStream& stream,
            uint64_t budget_bytes) {
  Built built;
  MemoryBudget budget(budget_bytes);
  CancelToken never;
  OrderedSink sink(built, task);
  built.outcome = backend.build(task, stream, budget, never, sink, built.summary);
  EXPECT_EQ(budget.used(), 0u) << "memory was not released";
  const bool has_dag = built.outcome == BuildOutcome::kBuilt && !built.summary.empty();
  EXPECT_EQ(built.sink_called, has_dag);
  return built;
}

Built build(Backend& backend, const SubvolumeTask& task, const oracle::Triangles& triangles,
            uint64_t budget_bytes) {
  oracle::VectorStream stream(oracle::fixed(triangles));
  return build(backend, task, stream, budget_bytes);
}

void expect_equals(const Built& built, const oracle::Dag& truth, const SubvolumeTask& task) {
  ASSERT_EQ(built.outcome, BuildOutcome::kBuilt);
  EXPECT_EQ(built.summary.voxels, truth.voxels);
  EXPECT_EQ(built.summary.svo_nodes, truth.svo_nodes);
  EXPECT_EQ(built.summary.dag_nodes, truth.dag_nodes);
  EXPECT_EQ(built.summary.root_hash, truth.root_hash);
  const SubDag expected = oracle::as_sub_dag(truth, task.grid_levels);
  EXPECT_TRUE(built.dag.brick_masks == expected.brick_masks) << "the brick level differs";
  ASSERT_EQ(built.dag.levels.size(), expected.levels.size());
  for (size_t i = 0; i < expected.levels.size(); ++i) {
    const SubDag::Nodes &got = built.dag.levels[i], &want = expected.levels[i];
    EXPECT_TRUE(got.hashes == want.hashes) << "hashes of level " << want.level << " differ";
    EXPECT_TRUE(got.masks == want.masks) << "masks of level " << want.level << " differ";
    EXPECT_TRUE(got.children == want.children) << "children of level " << want.level << " differ";
  }
  if (truth.voxels == 0) return;
  EXPECT_NO_THROW(check_sub_dag(built.dag, task.shape()));
}

void expect_right(Backend& backend, const SubvolumeTask& task, const oracle::Triangles& triangles) {
  const oracle::Region region = oracle::region_of(task.cube, task.grid_levels);
  const oracle::Dag truth =
      oracle::build_dag(oracle::voxelize(triangles, region), static_cast<int>(task.hash_bits));
  expect_equals(build(backend, task, triangles), truth, task);
}

oracle::Voxels voxels_of(const SubDag& dag, const Cube& cube, uint32_t grid_levels,
                         const oracle::Region& region) {
  oracle::Voxels out(region.edge);
  if (!dag.brick_masks.empty())
    Decoder{dag, region, out}.node(dag.levels.size(), 0, cube, grid_levels);
  return out;
}

}  // namespace voxdag
