// Builds the sub-DAG of a selection in one octree-aligned cube, a part of the grid.
//
// From the cube's root down, every level's nodes are collected (part_level.h) and then read in the
// order of their offsets. A cell of a coarser grid is set where the octree has a node, so the
// bricks of the selected grid are made from the nodes two levels above its cells and their
// children:
//
//     selected grid   nodes   ...   bricks          cells
//     file            nodes   ...   nodes at l-2    their children's masks, at l-1
//
// Then, from these bricks up, nodes that have become equal are merged (hash-consing), with the
// tables that also build subvolumes. Cells outside the region are left out on the way down. Nodes
// that the region cuts are added once per position, all others once.
#pragma once

#include <cstdint>
#include <vector>

#include "core/dag/consing/sub_dag_tables.h"
#include "core/dag/sub_dag.h"
#include "core/geometry/cube.h"
#include "query/dag/selection.h"
#include "query/extract/node_reader.h"
#include "query/extract/part_level.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

// A cube of the selected grid that has voxels of the file.
struct SelectedPart {
  Cube cube;
  uint64_t offset = 0;  // offset of its root in level cube.level of the file
};

class PartBuilder {
 public:
  PartBuilder(const voxdag_reader::File& file, const Selection& selection, NodeReader& reader,
              PooledMemory memory, const CancelToken& cancel)
      : file_(file), selection_(selection), reader_(reader), memory_(memory), cancel_(cancel) {}

  // Passes the part's level arrays to the sink; `shape` belongs to the new grid. Throws
  // OutOfBudget, before the first call of the sink, if the budget cannot hold the part.
  SubDagSummary build(const SelectedPart& part, const SubDagShape& shape, SubDagSink& sink);

  // Returns the parts that replace a part above the bricks: its children with selected cells.
  std::vector<SelectedPart> split(const SelectedPart& part);

 private:
  struct Built {
    NodeRef ref;
    OctreeCounts counts;
  };
  // The children of a level's nodes, by their numbers in the level below.
  struct Children {
    PooledArray<uint8_t> masks;   // by node number; without children outside the region
    PooledArray<uint32_t> first;  // by node number
    PooledArray<uint32_t> all;
    uint64_t count = 0;
  };

  uint32_t brick_level() const { return selection_.grid_levels - kBrickLevels; }
  // Returns the low corner and the edge of a cube, in cells of the selected grid.
  std::array<int64_t, 3> corner(uint32_t level, const PartLevel::Position& position) const;
  PartLevel level_of_part(uint32_t level) {
    return PartLevel(memory_, file_.level(level).pointer_bits == 64);
  }
  int64_t edge(uint32_t level) const { return int64_t{1} << (selection_.grid_levels - level); }

  // Reads the nodes of a level. Their children are added to `below`.
  template <class Visit>
  void read(uint32_t level, PartLevel& nodes, PartLevel& below, Children& children, Visit visit);
  void read_nodes(uint32_t level, PartLevel& nodes, PartLevel& below, Children& children);
  void read_all_children(uint32_t level, PartLevel& nodes, PartLevel& below, Children& children);
  PooledArray<uint64_t> read_bricks(PartLevel& bricks);
  PooledArray<uint8_t> read_cells(PartLevel& nodes);
  uint64_t selected_bits(const PartLevel::Position& brick) const;
  PooledArray<Built> build_bricks(PartLevel& bricks, SubDagTables& tables);
  PooledArray<Built> build_nodes(uint32_t level, uint64_t count, const Children& children,
                                 const PooledArray<Built>& below, SubDagTables& tables);

  const voxdag_reader::File& file_;
  const Selection& selection_;
  NodeReader& reader_;
  PooledMemory memory_;
  const CancelToken& cancel_;
};

}  // namespace voxdag::query
