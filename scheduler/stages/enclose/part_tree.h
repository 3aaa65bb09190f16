// The octree of the grid. Its leaves are given cubes, and the maximal empty cubes between them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/geometry/cube.h"

namespace voxdag {

class PartTree {
 public:
  static constexpr uint32_t kEmpty = UINT32_MAX;
  // A given cube, or a maximal empty cube.
  struct Leaf {
    Cube cube;
    uint32_t part = kEmpty;  // index of the given cube; kEmpty for an empty cube
  };
  // A node or a leaf.
  struct Ref {
    uint32_t index = 0;
    bool is_leaf = false;
  };

  // The cubes must be disjoint.
  explicit PartTree(std::span<const Cube> cubes);

  Ref root() const { return root_; }
  Ref child(Ref node, int octant) const { return nodes_[node.index][static_cast<size_t>(octant)]; }
  const std::vector<Leaf>& leaves() const { return leaves_; }
  uint64_t bytes() const {
    return leaves_.size() * sizeof(Leaf) + nodes_.size() * sizeof(nodes_[0]);
  }

 private:
  struct Placed {
    uint64_t code;  // Morton code of the cube's low corner on the finest level
    uint32_t part;
  };
  Ref add(const Cube& cube, std::span<const Placed> placed, std::span<const Cube> cubes);

  std::vector<Leaf> leaves_;
  std::vector<std::array<Ref, 8>> nodes_;
  Ref root_;
};

}  // namespace voxdag
