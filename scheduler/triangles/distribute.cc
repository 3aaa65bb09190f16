#include "scheduler/triangles/distribute.h"

#include <algorithm>

namespace voxdag {

CubeTree::CubeTree(uint32_t grid_levels, const Cube& root, std::span<const Cube> leaves)
    : grid_levels_(grid_levels), root_(root), deepest_(root.level), nodes_(1) {
  for (size_t leaf = 0; leaf < leaves.size(); ++leaf) {
    const Cube& cube = leaves[leaf];
    deepest_ = std::max(deepest_, cube.level);
    int32_t node = 0;
    for (uint32_t level = root.level + 1; level <= cube.level; ++level) {
      const int c = ancestor(cube, level).child_index();
      if (nodes_[node].child[c] == kNone) {
        nodes_[node].child[c] = static_cast<int32_t>(nodes_.size());
        nodes_.emplace_back();
      }
      node = nodes_[node].child[c];
    }
    nodes_[node].leaf = static_cast<int32_t>(leaf);
  }
}

void distribute(TriangleStream& triangles, const CubeTree& tree, BinWriter& writer,
                const CancelToken& cancel,
                const std::function<void(uint64_t copied)>& after_batch) {
  std::vector<FixedTriangle> batch(1024);
  uint64_t copied = 0;
  while (const size_t n = triangles.read(batch)) {
    cancel.check();
    for (size_t i = 0; i < n; ++i)
      tree.for_each_touched(batch[i], [&](size_t leaf) { writer.append(leaf, batch[i]); });
    copied += n;
    if (after_batch) after_batch(copied);
  }
  writer.flush();
}

void distribute(TriangleBins& bins, BinId from, const CubeTree& tree,
                const std::vector<BinId>& leaf_bins, size_t buffer_bytes,
                const CancelToken& cancel) {
  BinWriter writer(bins, leaf_bins, buffer_bytes);
  distribute(*bins.open(from), tree, writer, cancel);
  bins.drop(from);
}

}  // namespace voxdag
