#include "scheduler/triangles/partition.h"

#include <algorithm>
#include <array>
#include <map>
#include <string>

#include "scheduler/triangles/triangle_file.h"

namespace voxdag {
namespace {

void partition(TriangleStream& triangles, const CubeTree& tree, BinWriter& writer,
               const CancelToken& cancel,
               const std::function<void(size_t batch_size)>& after_batch = {}) {
  std::vector<FixedTriangle> batch(1024);
  while (const size_t n = triangles.read(batch)) {
    cancel.check();
    for (size_t i = 0; i < n; ++i)
      tree.for_each_touched(batch[i], [&](size_t leaf) { writer.append(leaf, batch[i]); });
    if (after_batch) after_batch(n);
  }
  writer.flush();
}

using BinsByCube = std::map<Cube, CubeBin>;

// The bin of the cube or of the nearest cube around it.
const CubeBin& nearest(const BinsByCube& bins, const Cube& wanted) {
  for (Cube cube = wanted;; cube = cube.parent()) {
    const auto found = bins.find(cube);
    if (found != bins.end()) return found->second;
    if (cube.level == 0)
      throw DamagedTriangles("the stored triangles have no bin for a cube of level " +
                             std::to_string(wanted.level));
  }
}

}  // namespace

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

void partition(TriangleStore& store, BinId from, const CubeTree& tree,
               const std::vector<BinId>& leaf_bins, size_t buffer_bytes,
               const CancelToken& cancel) {
  BinWriter writer(store, leaf_bins, buffer_bytes);
  partition(*store.open(from), tree, writer, cancel);
  store.drop(from);
}

void partition_scene(TriangleStore& store, uint32_t grid_levels, std::span<const Cube> cubes,
                     size_t buffer_bytes, const CancelToken& cancel, uint64_t first,
                     const AfterPartitionBatch& after_batch) {
  if (store.cube_bins().empty()) store.add_cube_bins(cubes);
  std::vector<Cube> leaves;
  std::vector<BinId> targets;
  for (const CubeBin& bin : store.cube_bins()) {
    leaves.push_back(bin.cube);
    targets.push_back(bin.bin);
  }
  BinWriter writer(store, targets, buffer_bytes);
  uint64_t copied = first;
  partition(*store.open(kSceneBin, first), CubeTree(grid_levels, Cube{}, leaves), writer, cancel,
            [&](size_t batch_size) { after_batch(copied += batch_size, writer); });
  store.drop(kSceneBin);
}

std::vector<BinId> assign_bins(TriangleStore& store, uint32_t grid_levels,
                               std::span<const Cube> cubes, size_t buffer_bytes,
                               const CancelToken& cancel) {
  BinsByCube by_cube;
  for (const CubeBin& bin : store.cube_bins()) by_cube[bin.cube] = bin;
  std::vector<BinId> assigned(cubes.size());
  std::map<Cube, std::vector<size_t>> parts;  // indexes into `cubes`, by the cube around them
  for (size_t i = 0; i < cubes.size(); ++i) {
    const CubeBin& found = nearest(by_cube, cubes[i]);
    if (found.cube == cubes[i]) {
      assigned[i] = found.bin;
      store.retain(found.bin);
    } else {
      assigned[i] = store.add_part(found.bin);
      parts[found.cube].push_back(i);
    }
  }
  for (const auto& [key, indexes] : parts) {
    const CubeBin& whole = by_cube[key];
    std::vector<Cube> leaves;
    std::vector<BinId> targets;
    for (const size_t i : indexes) {
      leaves.push_back(cubes[i]);
      targets.push_back(assigned[i]);
    }
    partition(store, whole.bin, CubeTree(grid_levels, whole.cube, leaves), targets, buffer_bytes,
              cancel);
  }
  // What was made of the others may be durable already.
  for (const CubeBin& bin : store.cube_bins()) store.release(bin.bin);
  return assigned;
}

}  // namespace voxdag
