// Builds the sub-DAG for one part of the grid: the selected cells in one octree-aligned cube.
//
// From the cube's root down, the nodes of every level are collected (part_level.h) and then read in
// the order of their offsets. On a grid coarser than the file's, a cell is set where the octree has
// a node. So the bricks of the selected grid, which has l levels, are made from the file's nodes
// two levels above the grid's cells and from the children of these nodes:
//
//     selected grid   nodes   ...   bricks          cells
//     file            nodes   ...   nodes at l-2    their children's masks, at l-1
//
// With MajorityCells, cells with too few voxels are removed from these masks.
//
// Then the tree is built from these bricks up. Nodes that have become equal are merged
// (hash-consing), with the same tables that are used to build subvolumes. Cells outside the region
// are left out on the way down. The region cuts a node if only a part of the node's cube is in the
// region. A level's list of nodes has a cut node once per position, and any other node only once.
#pragma once

#include <cstdint>
#include <vector>

#include "core/dag/consing/sub_dag_tables.h"
#include "core/dag/sub_dag.h"
#include "core/geometry/cube.h"
#include "query/dag/selection.h"
#include "query/extract/majority_cells.h"
#include "query/extract/node_reader.h"
#include "query/extract/part_level.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

// A cube of the selected grid in which the file has voxels.
struct SelectedPart {
  Cube cube;
  uint64_t offset = 0;  // word offset of the cube's root in level cube.level of the file
};

class PartBuilder {
 public:
  // `majority` has the set cells of the selected grid. If it is null, a cell is set if it has a
  // voxel.
  PartBuilder(const voxdag_reader::File& file, const Selection& selection,
              const MajorityCells* majority, NodeReader& reader, PooledMemory memory,
              const CancelToken& cancel)
      : file_(file),
        selection_(selection),
        majority_(majority),
        reader_(reader),
        memory_(memory),
        cancel_(cancel) {}

  // Passes the level arrays of the part to the sink; `shape` describes the new grid. If the budget
  // cannot hold the part, throws OutOfBudget before the first call of the sink.
  SubDagSummary build(const SelectedPart& part, const SubDagShape& shape, SubDagSink& sink);

  // Divides a part whose root is above the bricks: returns its children that have selected cells.
  std::vector<SelectedPart> split(const SelectedPart& part);

 private:
  struct Built {
    NodeRef ref;
    OctreeCounts counts;
  };
  // The children of the nodes of one level. `all` has the numbers of the children in the level
  // below. The children of node i begin at all[first[i]]; masks[i] is the node's child mask without
  // children outside the region.
  struct Children {
    PooledArray<uint8_t> masks;   // by node number
    PooledArray<uint32_t> first;  // by node number
    PooledArray<uint32_t> all;
    uint64_t count = 0;
  };

  uint32_t brick_level() const { return selection_.grid_levels - kBrickLevels; }
  // Return the low corner (corner()) and the edge (edge()) of a cube on this level, in cells of the
  // selected grid.
  std::array<int64_t, 3> corner(uint32_t level, const PartLevel::Position& position) const;
  PartLevel level_of_part(uint32_t level) {
    return PartLevel(memory_, file_.level(level).pointer_bits == 64);
  }
  int64_t edge(uint32_t level) const { return int64_t{1} << (selection_.grid_levels - level); }

  // Reads the nodes of a level. Calls visit(number, node) for each node. visit() must add the
  // node's children to `below` and `children`.
  template <class Visit>
  void read(uint32_t level, PartLevel& nodes, PartLevel& below, Children& children, Visit visit);
  void read_nodes(uint32_t level, PartLevel& nodes, PartLevel& below, Children& children);
  void read_all_children(uint32_t level, PartLevel& nodes, PartLevel& below, Children& children);
  PooledArray<uint64_t> read_bricks(PartLevel& bricks);
  PooledArray<uint8_t> read_cells(PartLevel& nodes);
  uint8_t cells_of_brick(uint64_t mask) const;
  uint8_t cells_of_node(const voxdag_reader::Node& node) const;
  uint64_t selected_bits(const PartLevel::Position& brick) const;
  PooledArray<Built> build_bricks(PartLevel& bricks, SubDagTables& tables);
  PooledArray<Built> build_nodes(uint32_t level, uint64_t count, const Children& children,
                                 const PooledArray<Built>& below, SubDagTables& tables);

  const voxdag_reader::File& file_;
  const Selection& selection_;
  const MajorityCells* const majority_;
  NodeReader& reader_;
  PooledMemory memory_;
  const CancelToken& cancel_;
};

}  // namespace voxdag::query
