#include "scheduler/stages/partition/partition.h"

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <string>

#include "core/base/page_buffer.h"
#include "core/base/parallel_for.h"
#include "scheduler/spec/memory_plan.h"
#include "scheduler/triangles/chunk.h"
#include "scheduler/triangles/triangle_file.h"

namespace voxdag {
namespace {

void partition(TriangleStream& triangles, const CubeTree& tree, BinWriter& writer,
               const CancelToken& cancel) {
  std::vector<FixedTriangle> batch(1024);
  CubeTree::Hint hint;
  while (const size_t n = triangles.read(batch)) {
    cancel.check();
    for (size_t i = 0; i < n; ++i)
      tree.for_each_touched(batch[i], hint, [&](size_t leaf) { writer.append(leaf, batch[i]); });
  }
  writer.flush();
}

constexpr size_t kPartitionPiece = 16384;
constexpr size_t kBatchTriangles = 256;

// A piece of the scene: consecutive triangles, in the order of the scene. Each triangle is encoded
// once for every leaf of the CubeTree (partition.h) that it touches.
class TouchedPiece {
 public:
  // Allocates space for 2 * kPartitionPiece records, or kPartitionPiece + `leaves` if that is more.
  // So the buffer always has space for the records of one triangle, even if it touches all leaves.
  TouchedPiece(const CubeTree& tree, size_t leaves, size_t record_bytes, MemoryBudget& budget)
      : tree_(tree),
        leaves_(leaves),
        record_bytes_(record_bytes),
        capacity_(kPartitionPiece + std::max(kPartitionPiece, leaves)),
        records_(budget, capacity_ * record_bytes, "a piece of the scene") {}

  void begin(std::unique_ptr<TriangleStream> triangles) {
    triangles_ = std::move(triangles);
    left_ = kPartitionPiece;
    batch_size_ = next_ = 0;
    fill();
  }
  // Replaces the records by the records of the next triangles, as many as fit in the buffer.
  // Returns false at the end of the piece.
  bool fill() {
    runs_.clear();
    used_ = 0;
    while (capacity_ - used_ >= leaves_ && read()) {
      const FixedTriangle& triangle = batch_[next_++];
      tree_.for_each_touched(triangle, hint_, [&](size_t leaf) {
        if (runs_.empty() || runs_.back().leaf != leaf) runs_.push_back({leaf, 0});
        ++runs_.back().records;
        encode_triangle(triangle, record_bytes_, records_.data() + used_++ * record_bytes_);
      });
    }
    return used_ > 0;
  }
  void copy(BinWriter& writer) const {
    const std::byte* from = records_.data();
    for (const Run& run : runs_) {
      const size_t bytes = run.records * record_bytes_;
      writer.append(run.leaf, {from, bytes});
      from += bytes;
    }
  }

 private:
  // Consecutive records of a leaf.
  struct Run {
    size_t leaf, records;
  };

  // Makes batch_[next_] the next triangle. Returns false at the end.
  bool read() {
    if (next_ < batch_size_) return true;
    const size_t n = std::min(left_, batch_.size());
    batch_size_ = n > 0 ? triangles_->read(std::span(batch_).first(n)) : 0;
    left_ -= batch_size_;
    next_ = 0;
    return batch_size_ > 0;
  }

  const CubeTree& tree_;
  CubeTree::Hint hint_;
  const size_t leaves_;
  const size_t record_bytes_;
  const size_t capacity_;  // capacity of records_, in records
  PageBuffer<std::byte> records_;
  size_t used_ = 0;
  std::vector<Run> runs_;
  std::unique_ptr<TriangleStream> triangles_;
  size_t left_ = 0;  // triangles of the piece that are not read yet
  std::array<FixedTriangle, kBatchTriangles> batch_;
  size_t batch_size_ = 0, next_ = 0;
};

using BinsByCube = std::map<Cube, CubeBin>;

// Returns the bin of the smallest cube that has a bin and is `wanted` or contains it.
const CubeBin& nearest(const BinsByCube& bins, const Cube& wanted) {
  for (Cube cube = wanted;; cube = cube.parent()) {
    const auto found = bins.find(cube);
    if (found != bins.end()) return found->second;
    if (cube.level == 0)
      throw DamagedTriangles(
          "the stored triangles have no bin for a cube of level " + std::to_string(wanted.level) +
          " at position (" + std::to_string(wanted.position[0]) + ", " +
          std::to_string(wanted.position[1]) + ", " + std::to_string(wanted.position[2]) +
          "): expected the cube's bin or the bin of a cube around it");
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
  const uint64_t pieces = (end - first + kPartitionPiece - 1) / kPartitionPiece;
  const unsigned threads = MemoryPlan::ingest_threads(pieces / MemoryPlan::kMinPiecesPerThread,
                                                      context.budget.available(), context.threads);
  std::vector<std::unique_ptr<TouchedPiece>> worker_pieces(threads);
  context.build.progress.begin_stage("partition", end, "triangles");
  context.build.progress.resume_at(first);
  parallel_for_in_order(
      threads, pieces,
      [&](unsigned worker, size_t item) {
        context.build.cancel.check();
        auto& piece = worker_pieces[worker];
        if (!piece)
          piece = std::make_unique<TouchedPiece>(tree, leaves.size(), store.record_bytes(),
                                                 context.budget);
        piece->begin(store.open(kSceneBin, first + item * kPartitionPiece));
      },
      [&](unsigned worker, size_t item) {
        TouchedPiece& piece = *worker_pieces[worker];
        do {
          context.build.cancel.check();
          piece.copy(writer);
        } while (piece.fill());
        const uint64_t begin = first + item * kPartitionPiece;
        const uint64_t count = std::min<uint64_t>(kPartitionPiece, end - begin);
        context.build.progress.advance(count);
        after_piece(begin + count, writer);
      });
  writer.flush();
  context.build.progress.end_stage();
  store.drop(kSceneBin);
}

std::vector<BinId> assign_bins(TriangleStore& store, uint32_t grid_levels,
                               std::span<const Cube> cubes, size_t buffer_bytes,
                               const StageContext& context) {
  BinsByCube by_cube;
  for (const CubeBin& bin : store.cube_bins()) by_cube[bin.cube] = bin;
  std::vector<BinId> assigned(cubes.size());
  std::map<Cube, std::vector<size_t>>
      parts_of;  // indexes into `cubes`, keyed by the enclosing cube
  for (size_t i = 0; i < cubes.size(); ++i) {
    const CubeBin& found = nearest(by_cube, cubes[i]);
    if (found.cube == cubes[i]) {
      assigned[i] = found.bin;
      store.retain(found.bin);
    } else {
      assigned[i] = store.add_part(found.bin);
      parts_of[found.cube].push_back(i);
    }
  }
  const std::vector<std::pair<Cube, std::vector<size_t>>> wholes(parts_of.begin(), parts_of.end());
  const unsigned threads =
      MemoryPlan::ingest_threads(wholes.size(), context.budget.available(), context.threads);
  parallel_for(threads, wholes.size(), [&](unsigned, size_t item) {
    const auto& [whole, parts] = wholes[item];
    std::vector<Cube> leaves;
    std::vector<BinId> targets;
    for (const size_t i : parts) {
      leaves.push_back(cubes[i]);
      targets.push_back(assigned[i]);
    }
    partition(store, by_cube.at(whole).bin, CubeTree(grid_levels, whole, leaves), targets,
              buffer_bytes / threads, context.build.cancel);
  });
  // Releases the reference with which each cube bin was created. This frees the bins of subvolumes
  // whose artifacts are already recorded.
  for (const CubeBin& bin : store.cube_bins()) store.release(bin.bin);
  return assigned;
}

}  // namespace voxdag
