// Random access to the vertex positions of an instance of a primitive, in world space or snapped to
// a grid, within a fixed amount of memory: blocks of consecutive vertices, each cached in the one
// slot that its number maps to. An instance that fits is read once. A larger instance is read about
// once if its indices are close together. A primitive of up to 262144 vertices is decoded once for
// all its instances.
#pragma once

#include <bit>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/base/page_buffer.h"
#include "core/geometry/grid.h"
#include "scene/vertices/position_source.h"
#include "scene/vertices/transform.h"

namespace voxdag {

class VertexCache {
 public:
  // The caches of all readers of a scene take at most 1/kShareOfFree of the free budget.
  static constexpr uint64_t kShareOfFree = 4;

  // One of `caches`. Room for `vertices`, or for as many as fit its part of that share.
  VertexCache(MemoryBudget& budget, uint64_t vertices, unsigned caches);

  // Forgets everything and serves `source` from now on, which must outlive its use. Needs place().
  void bind(PositionSource& source);
  // Serves the source's vertices after this transform, and snapped to the grid if there is one,
  // from now on. All coordinates of a vertex that is not finite after the transform become NaN.
  void place(const Transform& world, const Grid* grid);

  // Whether all vertices that were served since place() are finite.
  bool all_finite() const { return all_finite_; }
  // Three doubles, valid until the next call; `vertex` must be below the source's count.
  const double* at(uint64_t vertex) {
    const uint64_t block = vertex / kBlockVertices;
    const size_t slot = static_cast<size_t>(block) & slot_mask_;
    if (block_in_slot_[slot] != block) load(block, slot);
    return &positions_[3 * (slot * kBlockVertices + static_cast<size_t>(vertex % kBlockVertices))];
  }

 private:
  static constexpr uint64_t kBlockVertices = 1024;
  static constexpr uint64_t kMaxRetainedBlocks = 256;
  static constexpr uint64_t kNoBlock = ~uint64_t{0};

  void forget();
  void load(uint64_t block, size_t slot);
  void read(uint64_t block, std::span<double> out);

  PageBuffer<double> positions_;  // as they are served
  // The untransformed blocks of a small source, and which of them were read.
  PageBuffer<double> untransformed_;
  std::vector<bool> is_read_;
  Transform world_;
  std::optional<Grid> grid_;
  bool all_finite_ = true;
  std::vector<uint64_t> block_in_slot_;
  size_t slot_mask_ = 0;
  size_t slots_used_ = 0;  // by the source, counted from the first
  PositionSource* source_ = nullptr;
};

}  // namespace voxdag
