// The DAG of a cube of voxels, made directly from the definitions: bricks of 4x4x4 voxels, and
// above them nodes of up to eight children. Ordinary maps merge equal nodes level by level. Every
// level is in the order (hash, mask, child indices).
#pragma once

#include <cstdint>
#include <vector>

#include "tests/oracle/voxels.h"

namespace oracle {

// A second implementation of the node hash that docs/format.md defines.
uint64_t brick_hash(uint64_t mask);
uint64_t node_hash(uint32_t mask, const std::vector<uint64_t>& child_hashes);
// Returns the top `bits` of a hash; the other bits are 0.
uint64_t truncated(uint64_t hash, int bits);

struct Node {
  uint64_t hash = 0;               // truncated
  uint32_t mask = 0;               // bit 4x + 2y + z is set if the child at (x, y, z) exists
  std::vector<uint32_t> children;  // indices into the level below
  auto operator<=>(const Node&) const = default;
};

struct Dag {
  std::vector<uint64_t> bricks;           // masks
  std::vector<std::vector<Node>> levels;  // from the bricks' parents up to the root
  uint64_t voxels = 0;
  uint64_t svo_nodes = 0;  // nodes of the octree, bricks included
  uint64_t dag_nodes = 0;  // unique nodes, bricks included
  uint64_t root_hash = 0;  // truncated; 0 if there are no voxels
  bool operator==(const Dag&) const = default;
};

// Returns the DAG of `voxels`, whose edge is a power of two, 4 or more. If no voxel is set, the DAG
// has no levels.
Dag build_dag(const Voxels& voxels, int hash_bits);

}  // namespace oracle
