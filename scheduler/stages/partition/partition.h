// Partitions triangles: copies them from one bin to the bins of the cubes that they touch.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/geometry/octree_descent.h"
#include "scheduler/spec/build_spec.h"
#include "scheduler/triangles/triangle_store.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// An octree whose leaves are given, disjoint cubes. Finds the leaves that a triangle touches.
class CubeTree {
 public:
  // `root` contains all `leaves`.
  CubeTree(uint32_t grid_levels, const Cube& root, std::span<const Cube> leaves);
  // A leaf that contained an earlier triangle. The next triangle is probably in the same leaf.
  struct Hint {
    size_t leaf = 0;
    CubeInside inside;
  };
  // Calls visit(index into leaves) for every leaf that the triangle touches. Fast if the triangle
  // is inside the leaf of `hint`. If it is inside another leaf, `hint` is set to that leaf.
  template <class Visit>
  void for_each_touched(const FixedTriangle& triangle, Hint& hint, const Visit& visit) const {
    if (hint.inside.contains(triangle)) return visit(hint.leaf);
    int32_t node = 0;
    Cube cube = root_;
    // A triangle inside a cube touches no other cube of the same level. So no overlap test is
    // needed down to the smallest cube around the triangle.
    const CellBox box(triangle, grid_levels_, deepest_);
    if (const Cube around = box.is_inside_grid() ? box.cube_around() : Cube{};
        contains(root_, around))
      while (cube.level < around.level && nodes_[node].leaf == kNone) {
        cube = ancestor(around, cube.level + 1);
        node = nodes_[node].child[cube.child_index()];
        if (node == kNone) return;
        if (nodes_[node].leaf != kNone)
          hint = {static_cast<size_t>(nodes_[node].leaf), CubeInside(cube, grid_levels_)};
      }
    descend(node, cube, triangle, visit);
  }

 private:
  static constexpr int32_t kNone = -1;
  struct Node {
    int32_t child[8] = {kNone, kNone, kNone, kNone, kNone, kNone, kNone, kNone};
    int32_t leaf = kNone;  // index in `leaves`; kNone for inner nodes
  };

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

// Copies the triangles of bin `from` into `leaf_bins`, one for each leaf of the tree, and drops
// `from`. Uses `buffer_bytes` for incomplete chunks.
void partition(TriangleStore& store, BinId from, const CubeTree& tree,
               const std::vector<BinId>& leaf_bins, size_t buffer_bytes, const CancelToken& cancel);

// Called after each piece. `copied` is the number of the scene's triangles that are copied so far.
// These triangles are in the bins after writer.flush().
using AfterPartitionPiece = std::function<void(uint64_t copied, BinWriter& writer)>;

// Copies the scene's triangles, starting at index `first`, to the store's cube bins. Creates the
// bins for `cubes` unless an earlier run has created them. Several threads find the cubes that
// pieces of the scene touch; the pieces are copied in order. Drops the scene's bin.
void partition_scene(TriangleStore& store, uint32_t grid_levels, std::span<const Cube> cubes,
                     size_t buffer_bytes, uint64_t first, const StageContext& context,
                     const AfterPartitionPiece& after_piece);

// Returns one bin for each of `cubes`, in the same order, with the triangles that touch this cube.
// The bin is the cube's own bin if the store has one, and otherwise a part that is filled from the
// bin of the smallest enclosing cube. Each returned bin has one reference. Releases the other cube
// bins. Throws DamagedTriangles for a cube without an enclosing cube bin.
std::vector<BinId> assign_bins(TriangleStore& store, uint32_t grid_levels,
                               std::span<const Cube> cubes, size_t buffer_bytes,
                               const StageContext& context);

}  // namespace voxdag
