// All unique nodes of one subvolume while it is being built, one table per level, and how many
// octree nodes and voxels they stand for.
#pragma once

#include <cstdint>
#include <vector>

#include "core/backend/cpu/tables/brick_table.h"
#include "core/backend/cpu/tables/node_table.h"
#include "core/dag/brick.h"
#include "core/dag/sub_dag.h"

namespace voxdag::cpu {

// A node of a known level, or nothing at all (an empty cube): its id in that level's table and its
// uncut hash, carried along so that hashing a parent need not look its children up.
struct NodeRef {
  uint64_t hash = 0;
  uint32_t id = 0;
  bool exists = false;
};

// Octree nodes (bricks included) and set voxels of a cube, with multiplicity.
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

// How many entries the tables of a cube had, by s: room that the next cube will want too.
struct TableSizes {
  uint64_t entries[kMaxGridLevels + 1] = {};
};

// A cube of `size_log2` s has an edge of 2^s voxels; bricks are s = 2.
class SubDagTables {
 public:
  SubDagTables(Memory& memory, int size_log2, const TableSizes& expected = {});

  int size_log2() const { return kBrickLevels + static_cast<int>(nodes_.size()); }
  BrickTable& bricks() { return bricks_; }
  // Of cubes of 2^size_log2 voxels, size_log2 > 2.
  NodeTable& nodes(int size_log2) { return nodes_[size_log2 - kBrickLevels - 1]; }
  Memory& memory() { return memory_; }

  OctreeCounts& counts() { return counts_; }
  TableSizes sizes() const;

  // A brick that may be empty, counted as one octree node more if it is not.
  NodeRef add_brick(uint64_t mask);
  // The node above eight cubes of half its size, counted as one octree node more.
  NodeRef add_node(int size_log2, const NodeRef (&children)[8]);

 private:
  Memory& memory_;
  BrickTable bricks_;
  std::vector<NodeTable> nodes_;
  OctreeCounts counts_;
};

// Hands the level arrays to the sink and fills the rest of the summary. Throws Outgrown before the
// first call of the sink when the budget cannot hold the largest level array beside the tables.
SubDagSummary emit_levels(SubDagTables& tables, uint32_t grid_levels, uint32_t hash_bits,
                          SubDagSink& sink);

}  // namespace voxdag::cpu
