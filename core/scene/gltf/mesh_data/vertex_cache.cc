#include "core/scene/gltf/mesh_data/vertex_cache.h"

#include <algorithm>

namespace voxdag::gltf {

VertexCache::VertexCache(MemoryBudget& budget, uint64_t vertices, unsigned caches) {
  constexpr uint64_t kSlotBytes = kBlockVertices * 3 * sizeof(double);
  const uint64_t wanted = std::bit_ceil((vertices + kBlockVertices - 1) / kBlockVertices);
  const uint64_t affordable =
      std::bit_floor(budget.available() / kShareOfFree / caches / kSlotBytes);
  const uint64_t slots = std::clamp<uint64_t>(std::min(wanted, affordable), 1, wanted);
  positions_ = PageBuffer<double>(budget, static_cast<size_t>(slots * kBlockVertices * 3),
                                  "vertices of a scene");
  block_in_slot_.assign(static_cast<size_t>(slots), kNoBlock);
  slot_mask_ = static_cast<size_t>(slots - 1);
}

void VertexCache::bind(VertexSource& source) {
  const auto used = block_in_slot_.begin() + static_cast<ptrdiff_t>(slots_used_);
  std::fill(block_in_slot_.begin(), used, kNoBlock);
  const uint64_t blocks = (source.count() + kBlockVertices - 1) / kBlockVertices;
  slots_used_ = static_cast<size_t>(std::min<uint64_t>(blocks, block_in_slot_.size()));
  source_ = &source;
}

void VertexCache::load(uint64_t block, size_t slot) {
  block_in_slot_[slot] = kNoBlock;
  const uint64_t first = block * kBlockVertices;
  const uint64_t count = std::min(kBlockVertices, source_->count() - first);
  source_->read(first, static_cast<size_t>(count), &positions_[3 * slot * kBlockVertices]);
  block_in_slot_[slot] = block;
}

}  // namespace voxdag::gltf
