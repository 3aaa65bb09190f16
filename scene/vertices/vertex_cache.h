// Random access to the vertex positions of an instance of a primitive, in world space or snapped to
// a grid, within a fixed amount of memory. Blocks of consecutive vertices are cached; block b can
// only be in slot b modulo the number of slots. If all vertices of an instance fit in the cache,
// each is read once. Otherwise each is read about once, if the instance's indices are close
// together. A primitive of up to 262144 vertices is decoded once for all its instances, if the
// memory suffices.
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
  // All caches of a scene together take at most 1/kShareOfFree of the bytes that are free in the
  // memory budget.
  static constexpr uint64_t kShareOfFree = 4;

  // Makes one of `caches` caches that divide 1/kShareOfFree of the free bytes equally. The cache
  // has space for `vertices` vertices, or for fewer if its part of the bytes is smaller.
  VertexCache(MemoryBudget& budget, uint64_t vertices, unsigned caches);

  // Clears the cache and changes to `source`, which must exist as long as at() is called. place()
  // must be called next.
  void bind(PositionSource& source);
  // From this call on, at() returns the source's vertices transformed by `world` and, if `grid` is
  // not null, snapped to it. If a vertex is not finite after the transform, all its coordinates are
  // NaN.
  void place(const Transform& world, const Grid* grid);

  // True if all vertices returned since place() are finite.
  bool all_finite() const { return all_finite_; }
  // Returns the position of a vertex: three doubles, valid until the next call. `vertex` must be
  // below the source's count.
  const double* at(uint64_t vertex) {
    const uint64_t block = vertex / kBlockVertices;
    const size_t slot = static_cast<size_t>(block) & slot_mask_;
    if (block_in_slot_[slot] != block) load(block, slot);
    return &positions_[3 * (slot * kBlockVertices + static_cast<size_t>(vertex % kBlockVertices))];
  }

 private:
  static constexpr uint64_t kBlockVertices = 1024;
  static constexpr uint64_t kBlocksPerRead = 8;
  static constexpr uint64_t kMaxRetainedBlocks = 256;
  static constexpr uint64_t kNoBlock = ~uint64_t{0};

  void forget();
  void load(uint64_t block, size_t slot);
  void read(uint64_t block, std::span<double> out);
  uint64_t read_blocks(uint64_t block, uint64_t end);

  PageBuffer<double> positions_;  // transformed and snapped positions of the cached blocks
  // The untransformed vertices of the source, if all of them fit here. Then vertices are not read
  // again after place(). is_read_ has a flag per block, which is true once the block was read; it
  // is empty for a source that does not fit.
  PageBuffer<double> untransformed_;
  std::vector<bool> is_read_;
  Transform world_;
  std::optional<Grid> grid_;
  bool all_finite_ = true;
  std::vector<uint64_t> block_in_slot_;
  size_t slot_mask_ = 0;
  size_t slots_used_ = 0;  // number of slots that the source uses
  PositionSource* source_ = nullptr;
};

}  // namespace voxdag
