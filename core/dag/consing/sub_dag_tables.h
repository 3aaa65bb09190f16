// All unique nodes of one subvolume while it is built, in one table per level, and the numbers of
// octree nodes and voxels that the nodes represent. Not thread-safe.
#pragma once

#include <cstdint>
#include <vector>

#include "core/dag/brick.h"
#include "core/dag/consing/brick_table.h"
#include "core/dag/consing/node_table.h"
#include "core/dag/sub_dag.h"

namespace voxdag {

// A node in the table of its level: its id in the table, and its complete hash. With the hash, a
// parent can be hashed without a lookup of its children. `exists` is false for an empty cube, which
// has no node.
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

// Returns the counts of a cube with an edge of 2^size_log2 voxels, all of them set; size_log2 >= 2.
constexpr OctreeCounts full_counts(int size_log2) {
  OctreeCounts counts{0, uint64_t{1} << 3 * size_log2};
  for (int s = kBrickLevels; s <= size_log2; ++s) counts.nodes = 8 * counts.nodes + 1;
  return counts;
}

// The numbers of entries in the tables of one cube. entries[s] is for the table of the nodes whose
// cubes have an edge of 2^s voxels. The numbers for one cube are used as an estimate for the next
// cube.
struct TableSizes {
  uint64_t entries[kMaxGridLevels + 1] = {};
};

// The tables of a cube. A cube of `size_log2` = s has an edge of 2^s voxels; bricks have s = 2. The
// constructor reserves memory for tables of the sizes in `expected`, an estimate.
class SubDagTables {
 public:
  SubDagTables(PooledMemory& memory, int size_log2, const TableSizes& expected = {});

  int size_log2() const { return kBrickLevels + static_cast<int>(nodes_.size()); }
  BrickTable& bricks() { return bricks_; }
  // Returns the table for nodes whose cubes have an edge of 2^size_log2 voxels, size_log2 > 2.
  NodeTable& nodes(int size_log2) { return nodes_[size_log2 - kBrickLevels - 1]; }
  PooledMemory& memory() { return memory_; }

  OctreeCounts& counts() { return counts_; }
  TableSizes sizes() const;

  // Adds a brick, and counts one octree node and the brick's voxels. If the brick is empty, does
  // nothing and returns a NodeRef whose `exists` is false.
  NodeRef add_brick(uint64_t mask);
  // Adds the node of a cube whose octants are `children`, and counts one octree node. If no child
  // exists, does nothing and returns a NodeRef whose `exists` is false.
  NodeRef add_node(int size_log2, const NodeRef (&children)[8]);

 private:
  PooledMemory& memory_;
  BrickTable bricks_;
  std::vector<NodeTable> nodes_;
  OctreeCounts counts_;
};

// Passes the level arrays to the sink and returns the totals. Throws OutOfBudget if the budget
// cannot hold the largest level array in addition to the tables; the sink is then not called.
SubDagSummary emit_levels(SubDagTables& tables, const SubDagShape& shape, SubDagSink& sink);

}  // namespace voxdag
