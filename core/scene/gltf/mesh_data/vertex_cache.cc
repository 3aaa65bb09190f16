#include "core/scene/gltf/mesh_data/vertex_cache.h"

#include <algorithm>
#include <cstring>

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
  forget();
  const uint64_t blocks = (source.count() + kBlockVertices - 1) / kBlockVertices;
  slots_used_ = static_cast<size_t>(std::min<uint64_t>(blocks, block_in_slot_.size()));
  one_block_.clear();
  source_ = &source;
}

void VertexCache::place(const Transform& world) {
  if (std::memcmp(&world, &world_, sizeof world) != 0) forget();
  world_ = world;
}

void VertexCache::forget() {
  const auto used = block_in_slot_.begin() + static_cast<ptrdiff_t>(slots_used_);
  std::fill(block_in_slot_.begin(), used, kNoBlock);
  all_finite_ = true;
}

void VertexCache::load(uint64_t block, size_t slot) {
  block_in_slot_[slot] = kNoBlock;
  const uint64_t first = block * kBlockVertices;
  const auto count = static_cast<size_t>(std::min(kBlockVertices, source_->count() - first));
  double* const out = &positions_[3 * slot * kBlockVertices];
  if (one_block_.empty()) {
    source_->read(first, count, out);
    if (source_->count() <= kBlockVertices) one_block_.assign(out, out + 3 * count);
  } else {
    std::ranges::copy(one_block_, out);
  }
  for (double* vertex = out; vertex != out + 3 * count; vertex += 3) {
    const double local[3] = {vertex[0], vertex[1], vertex[2]};
    apply(world_, local, vertex);
    all_finite_ &= (vertex[0] - vertex[0]) + (vertex[1] - vertex[1]) + (vertex[2] - vertex[2]) == 0;
  }
  block_in_slot_[slot] = block;
}

}  // namespace voxdag::gltf
