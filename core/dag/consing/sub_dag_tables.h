// All unique nodes of one subvolume while it is being built, one table per level, and the number of
// octree nodes and voxels that they represent. Not thread-safe.
#pragma once

#include <cstdint>
#include <vector>

#include "core/dag/brick.h"
#include "core/dag/consing/brick_table.h"
#include "core/dag/consing/node_table.h"
#include "core/dag/sub_dag.h"

namespace voxdag {

// A node of a known level: its id in that level's table, and its full hash, so that hashing a
// parent needs no lookup of its children. `exists` is false for an empty cube, which has no node.
struct NodeRef {
  uint64_t hash = 0;
  uint32_t id = 0;
  bool exists = false;
};

// The numbers of octree nodes (including bricks) and set voxels of a cube. A shared node counts
// once for each of its occurrences.
struct OctreeCounts {
  uint64_t nodes = 0;
  uint64_t voxels = 0;

  OctreeCounts& operator+=(const OctreeCounts& o) {
    nodes += o.nodes;
    voxels += o.voxels;
    return *this;
  }
  OctreeCounts operator-(const OctreeCounts& o) const {
    return {nodes - o.nodes, voxels - o.voxels};
  }
};

// The numbers of entries in the tables of one cube; entries[s] is for the table of cubes of edge
// 2^s. The numbers of one cube are an estimate for the next cube.
struct TableSizes {
  uint64_t entries[kMaxGridLevels + 1] = {};
};

// A cube of `size_log2` = s has an edge of 2^s voxels; bricks have s = 2.
class SubDagTables {
 public:
  SubDagTables(PooledMemory& memory, int size_log2, const TableSizes& expected = {});

  int size_log2() const { return kBrickLevels + static_cast<int>(nodes_.size()); }
  BrickTable& bricks() { return bricks_; }
  // The table for cubes of edge 2^size_log2, size_log2 > 2.
  NodeTable& nodes(int size_log2) { return nodes_[size_log2 - kBrickLevels - 1]; }
  PooledMemory& memory() { return memory_; }

  OctreeCounts& counts() { return counts_; }
  TableSizes sizes() const;

  // Adds a brick, which may be empty. Counts one octree node if it is not empty.
  NodeRef add_brick(uint64_t mask);
  // Adds the parent of eight cubes of half its size. Counts one octree node if the parent is not
  // empty.
  NodeRef add_node(int size_log2, const NodeRef (&children)[8]);

 private:
  PooledMemory& memory_;
  BrickTable bricks_;
  std::vector<NodeTable> nodes_;
  OctreeCounts counts_;
};

// Passes the level arrays to the sink and returns the totals. Throws OutOfBudget before the first
// call of the sink if the budget cannot hold the largest level array in addition to the tables.
SubDagSummary emit_levels(SubDagTables& tables, const SubDagShape& shape, SubDagSink& sink);

}  // namespace voxdag
