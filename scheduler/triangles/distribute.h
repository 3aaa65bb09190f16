// Hands triangles from one bin down to the bins of the subvolumes that they touch.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/base/cancel_token.h"
#include "core/geometry/octree_descent.h"
#include "scheduler/triangles/triangle_bins.h"

namespace voxdag {

// The tree above a set of disjoint cubes, to find which of them a triangle touches.
class CubeTree {
 public:
  CubeTree(uint32_t grid_levels, const Cube& root, std::span<const Cube> leaves);
  // Calls visit(index into leaves) for every leaf that the triangle touches.
  template <class Visit>
  void for_each_touched(const FixedTriangle& triangle, const Visit& visit) const {
    int32_t node = 0;
    Cube cube = root_;
    // As far as one cube holds all of the triangle, it touches that one and no other.
    const CellBox box(triangle, grid_levels_, deepest_);
    if (const Cube around = box.is_inside_grid() ? box.cube_around() : Cube{}; holds(around))
      while (cube.level < around.level && nodes_[node].leaf == kNone) {
        cube = ancestor(around, cube.level + 1);
        node = nodes_[node].child[cube.child_index()];
        if (node == kNone) return;
      }
    descend(node, cube, triangle, visit);
  }

 private:
  static constexpr int32_t kNone = -1;
  struct Node {
    int32_t child[8] = {kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone};
    int32_t leaf = kNone;  // index of the leaf that this node is, if it is one
  };

  bool holds(const Cube& cube) const {
    return cube.level >= root_.level && ancestor(cube, root_.level) == root_;
  }
  template <class Visit>
  void descend(int32_t node, const Cube& cube, const FixedTriangle& triangle,
               const Visit& visit) const {
    if (nodes_[node].leaf != kNone) return visit(static_cast<size_t>(nodes_[node].leaf));
    const int64_t units = cube.edge_voxels(grid_levels_) * kUnitsPerVoxel;
    for (uint32_t mask = touched_children(triangle, cube, units); mask; mask &= mask - 1) {
      const int c = lowest_bit(mask);
      if (nodes_[node].child[c] != kNone)
        descend(nodes_[node].child[c], cube.child(c), triangle, visit);
    }
  }

  uint32_t grid_levels_;
  Cube root_;
  uint32_t deepest_;  // level of the smallest leaves
  std::vector<Node> nodes_;
};

// Copies the triangles of a stream into the bins (one a leaf, in the same order, the targets of
// `writer`) of the cubes that they touch. `after_batch` hears how many of the stream were copied.
void distribute(TriangleStream& triangles, const CubeTree& tree, BinWriter& writer,
                const CancelToken& cancel,
                const std::function<void(uint64_t copied)>& after_batch = {});
// Moves all triangles of a bin like that, and drops it.
void distribute(TriangleBins& bins, BinId from, const CubeTree& tree,
                const std::vector<BinId>& leaf_bins, size_t buffer_bytes,
                const CancelToken& cancel);

}  // namespace voxdag
