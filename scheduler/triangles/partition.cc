#include "scheduler/triangles/partition.h"

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <string>

#include "core/base/page_buffer.h"
#include "core/base/turns.h"
#include "scheduler/memory_plan.h"
#include "scheduler/triangles/triangle_file.h"

namespace voxdag {
namespace {

void partition(TriangleStream& triangles, const CubeTree& tree, BinWriter& writer,
               const CancelToken& cancel) {
  std::vector<FixedTriangle> batch(1024);
  while (const size_t n = triangles.read(batch)) {
    cancel.check();
    for (size_t i = 0; i < n; ++i)
      tree.for_each_touched(batch[i], [&](size_t leaf) { writer.append(leaf, batch[i]); });
  }
  writer.flush();
}

constexpr size_t kPieceTriangles = 16384;
// What a thread finds before the piece's turn; large triangles touch thousands of leaves each.
constexpr size_t kMaxTouches = size_t{1} << 17;

// Some triangles of the scene, and the leaves that they touch.
class TouchedPiece {
 public:
  explicit TouchedPiece(MemoryBudget& budget)
      : triangles_(budget, kPieceTriangles, "a piece of the scene"),
        touches_(budget, kMaxTouches, "a piece of the scene") {}

  // Reads the piece and finds the leaves of its triangles, or of the first of them.
  void read(TriangleStream& stream, const CubeTree& tree) {
    count_ = stream.read({triangles_.data(), kPieceTriangles});
    touch_count_ = 0;
    for (known_ = 0; known_ < count_; ++known_) {
      size_t touches = touch_count_;
      tree.for_each_touched(triangles_[known_], [&](size_t leaf) {
        if (touches < kMaxTouches)
          touches_[touches] = {static_cast<uint32_t>(known_), static_cast<uint32_t>(leaf)};
        ++touches;
      });
      if (touches > kMaxTouches) break;
      touch_count_ = touches;
    }
  }
  // Copies the triangles to the leaves.
  void copy(const CubeTree& tree, BinWriter& writer) const {
    for (size_t i = 0; i < touch_count_; ++i)
      writer.append(touches_[i].leaf, triangles_[touches_[i].triangle]);
    for (size_t i = known_; i < count_; ++i)
      tree.for_each_touched(triangles_[i],
                            [&](size_t leaf) { writer.append(leaf, triangles_[i]); });
  }
  size_t count() const { return count_; }

 private:
  struct Touch {
    uint32_t triangle, leaf;
  };

  PageBuffer<FixedTriangle> triangles_;
  PageBuffer<Touch> touches_;
  size_t count_ = 0;  // of triangles
  size_t known_ = 0;  // of triangles whose touches are in touches_
  size_t touch_count_ = 0;
};

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
                     size_t buffer_bytes, uint64_t first, const StageContext& context,
                     const AfterPartitionPiece& after_piece) {
  if (store.cube_bins().empty()) store.add_cube_bins(cubes);
  std::vector<Cube> leaves;
  std::vector<BinId> targets;
  for (const CubeBin& bin : store.cube_bins()) {
    leaves.push_back(bin.cube);
    targets.push_back(bin.bin);
  }
  const CubeTree tree(grid_levels, Cube{}, leaves);
  BinWriter writer(store, targets, buffer_bytes);
  const uint64_t end = std::max(store.count(kSceneBin), first);
  const uint64_t pieces = (end - first + kPieceTriangles - 1) / kPieceTriangles;
  const auto threads = static_cast<unsigned>(
      std::clamp<uint64_t>(std::min(pieces, MemoryPlan::ingest_workers(context.budget.available())),
                           1, context.threads));
  std::vector<std::optional<TouchedPiece>> worker_pieces(threads);
  context.build.progress.begin_stage("partition", end, "triangles");
  context.build.progress.advance(first);
  parallel_for_in_order(
      threads, pieces,
      [&](unsigned worker, size_t item) {
        context.build.cancel.check();
        if (!worker_pieces[worker]) worker_pieces[worker].emplace(context.budget);
        worker_pieces[worker]->read(*store.open(kSceneBin, first + item * kPieceTriangles), tree);
      },
      [&](unsigned worker, size_t item) {
        const TouchedPiece& piece = *worker_pieces[worker];
        piece.copy(tree, writer);
        context.build.progress.advance(piece.count());
        after_piece(first + item * kPieceTriangles + piece.count(), writer);
      });
  writer.flush();
  context.build.progress.end_stage();
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
