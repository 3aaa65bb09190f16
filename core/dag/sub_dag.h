// A sub-DAG: the DAG of one subvolume. A backend delivers it level by level to a SubDagSink.
#pragma once

#include <cstdint>
#include <vector>

#include "core/dag/brick.h"
#include "core/dag/level_array.h"
#include "core/geometry/cube.h"

namespace voxdag {

// Properties that all sub-DAGs of one DAG share. Initialize them by name:
// `{.grid_levels = 11, .hash_bits = 64}`.
struct DagShape {
  uint32_t grid_levels = 2;  // L; bricks are level L-2
  uint32_t hash_bits = 64;   // 4 to 64

  uint32_t brick_level() const { return grid_levels - kBrickLevels; }
  bool operator==(const DagShape&) const = default;
};

// The levels of a sub-DAG, from its root to its bricks, and its hash bits. This is a struct so that
// callers name the numbers (`{.cube_level = 2, .grid_levels = 11, .hash_bits = 64}`). As adjacent
// parameters, the numbers could be swapped by mistake.
struct SubDagShape {
  uint32_t cube_level = 0;   // level of the root
  uint32_t grid_levels = 2;  // L; bricks are level L-2
  uint32_t hash_bits = 64;   // 4 to 64

  uint32_t brick_level() const { return grid_levels - kBrickLevels; }
};

// Totals of a built subvolume.
struct SubDagSummary {
  uint64_t voxels = 0;     // set voxels in the cube
  uint64_t svo_nodes = 0;  // octree nodes from the cube's root to the bricks, inclusive
  uint64_t dag_nodes = 0;  // unique nodes, including bricks
  uint64_t root_hash = 0;  // hash of the root, truncated to the hash bits; 0 when empty
  uint64_t interior = 0;   // voxels of a solid that are not in its shell
  uint64_t disputed = 0;   // voxels of the interior whose unit is_disputed() (solid_rule.h)
  bool empty() const { return voxels == 0; }
};

// Receives a sub-DAG from the bricks upwards: bricks() once, then nodes() for every level from L-3
// up to the level of the subvolume's cube. The last array has exactly one node, the root. For an
// empty subvolume, no function is called. The views are only valid during the call.
class SubDagSink {
 public:
  virtual ~SubDagSink() = default;
  virtual void bricks(const BrickLevelView& level) = 0;
  virtual void nodes(const NodeLevelView& level) = 0;
};

// A complete sub-DAG in memory, for tests, benchmarks and the check of a backend before a build.
struct SubDag : SubDagSink {
  struct Nodes {
    uint32_t level = 0;
    std::vector<uint64_t> hashes;
    std::vector<uint8_t> masks;
    std::vector<uint32_t> children;
    NodeLevelView view() const { return {level, hashes, masks, children}; }
    bool operator==(const Nodes&) const = default;
  };
  std::vector<uint64_t> brick_masks;
  std::vector<Nodes> levels;  // from L-3 upwards

  void bricks(const BrickLevelView& level) override {
    brick_masks.assign(level.masks.begin(), level.masks.end());
  }
  void nodes(const NodeLevelView& level) override {
    levels.push_back({level.level,
                      {level.hashes.begin(), level.hashes.end()},
                      {level.masks.begin(), level.masks.end()},
                      {level.children.begin(), level.children.end()}});
  }
  bool operator==(const SubDag& o) const {
    return brick_masks == o.brick_masks && levels == o.levels;
  }
};

}  // namespace voxdag
