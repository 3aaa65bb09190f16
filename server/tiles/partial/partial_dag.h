// The built subvolumes of a job as a DAG of the job's grid, for viewers. A coarse brick of 4x4x4
// cells represents each subvolume, and a cell that contains voxels is completely solid. Equal
// subtrees are one node, so solid cells cost almost nothing at any resolution.
//
// The DAG only grows: add() adds new nodes and a new root. So the contents of an address never
// change, and a viewer can keep all its tiles when the root changes. Used by one thread.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "core/geometry/cube.h"
#include "query/dag/dag_view.h"

namespace voxdag::server {

class PartialDag {
 public:
  struct Part {
    Cube cube;
    uint64_t brick = 0;  // its cells, with bits in the order of a brick's voxels
  };

  explicit PartialDag(uint32_t grid_levels);

  // Adds nodes for these parts, and returns the word offset of the root of the DAG that contains
  // exactly these parts; nullopt if `parts` is empty. Throws Error{kCorrupt} if two parts overlap,
  // or if a part is outside the grid.
  std::optional<uint64_t> add(const std::vector<Part>& parts);

  // The words of each level, from the root's down to the bricks'.
  const std::vector<std::vector<uint32_t>>& levels() const { return levels_; }
  uint64_t word_count() const { return word_count_; }

 private:
  using Parts = std::vector<const Part*>;
  uint64_t add_parts(const Cube& cube, const Parts& parts);
  // These functions add a node and return its word offset. add_coarse() adds the node of a coarse
  // brick, whose occupied cells are solid.
  uint64_t add_coarse(uint32_t level, uint64_t brick);
  uint64_t add_solid(uint32_t level);
  // Adds a node whose octants in `mask` are solid. All other octants are empty.
  uint64_t add_octants(uint32_t level, uint32_t mask);
  uint64_t add_node(uint32_t level, uint32_t mask, const std::vector<uint64_t>& children);
  uint64_t add_brick(uint64_t brick);
  uint64_t add_words(uint32_t level, std::vector<uint32_t> words);

  const uint32_t brick_level_;
  std::vector<std::vector<uint32_t>> levels_;
  std::vector<std::map<std::vector<uint32_t>, uint64_t>> known_;  // offsets of nodes, by level
  // Offsets of the nodes of coarse bricks and of solid cells, by level. If add() finds a coarse
  // brick or solid cell here, it does not make the nodes below it again.
  std::vector<std::map<uint64_t, uint64_t>> coarse_;
  std::vector<std::optional<uint64_t>> solid_;
  uint64_t word_count_ = 0;
};

// An immutable copy of a PartialDag, which several threads may read.
class PartialDagCopy {
 public:
  explicit PartialDagCopy(const PartialDag& dag, uint32_t grid_levels);
  PartialDagCopy(const PartialDagCopy&) = delete;
  const query::DagView& view() const { return view_; }

 private:
  const std::vector<std::vector<uint32_t>> levels_;
  const query::DagView view_;
};

}  // namespace voxdag::server
