#include "scene/vertices/vertex_cache.h"

#include <algorithm>
#include <cstring>
#include <limits>

#include "core/base/error.h"

namespace voxdag {

VertexCache::VertexCache(MemoryBudget& budget, uint64_t vertices, unsigned caches) {
  constexpr uint64_t kBlockBytes = kBlockVertices * 3 * sizeof(double);
  const uint64_t blocks = (vertices + kBlockVertices - 1) / kBlockVertices;
  const uint64_t fits_budget = budget.available() / kShareOfFree / caches / kBlockBytes;
  const uint64_t retained = std::min({blocks, kMaxRetainedBlocks, fits_budget / 2});
  const uint64_t wanted = std::bit_ceil(blocks);
  const uint64_t slots =
      std::clamp<uint64_t>(std::min(wanted, std::bit_floor(fits_budget - retained)), 1, wanted);
  const auto positions = [&](uint64_t count) {
    return PageBuffer<double>(budget, static_cast<size_t>(count * kBlockVertices * 3),
                              "vertices of a scene");
  };
  positions_ = positions(slots);
  untransformed_ = positions(retained);
  block_in_slot_.assign(static_cast<size_t>(slots), kNoBlock);
  slot_mask_ = static_cast<size_t>(slots - 1);
}

void VertexCache::bind(PositionSource& source) {
  forget();
  const uint64_t blocks = (source.count() + kBlockVertices - 1) / kBlockVertices;
  slots_used_ = static_cast<size_t>(std::min<uint64_t>(blocks, block_in_slot_.size()));
  const bool is_retained = blocks * kBlockVertices * 3 <= untransformed_.size();
  is_read_.assign(is_retained ? static_cast<size_t>(blocks) : 0, false);
  source_ = &source;
}

void VertexCache::place(const Transform& world, const Grid* grid) {
  const bool is_same_grid = grid ? grid_ == *grid : !grid_;
  if (is_same_grid && std::memcmp(&world, &world_, sizeof world) == 0) return;
  forget();
  world_ = world;
  if (!is_same_grid) grid_ = grid ? std::optional(*grid) : std::nullopt;
}

void VertexCache::forget() {
  const auto used = block_in_slot_.begin() + static_cast<ptrdiff_t>(slots_used_);
  std::fill(block_in_slot_.begin(), used, kNoBlock);
  all_finite_ = true;
}

void VertexCache::load(uint64_t block, size_t slot) {
  block_in_slot_[slot] = kNoBlock;
  const auto count =
      static_cast<size_t>(std::min(kBlockVertices, source_->count() - block * kBlockVertices));
  const std::span<double> out(&positions_[3 * slot * kBlockVertices], 3 * count);
  read(block, out);
  for (size_t i = 0; i < out.size(); i += 3) {
    double* const vertex = &out[i];
    const double local[3] = {vertex[0], vertex[1], vertex[2]};
    apply(world_, local, vertex);
    if ((vertex[0] - vertex[0]) + (vertex[1] - vertex[1]) + (vertex[2] - vertex[2]) != 0) {
      std::fill_n(vertex, 3, std::numeric_limits<double>::quiet_NaN());
      all_finite_ = false;
    }
  }
  if (grid_) snap_vertices(*grid_, out);
  block_in_slot_[slot] = block;
}

// Reads the blocks [block, end) of the source into untransformed_. If this fails, reads only the
// first block, because the others can have damaged vertices that no triangle uses. Returns the end
// of the blocks that were read.
uint64_t VertexCache::read_blocks(uint64_t block, uint64_t end) {
  const uint64_t first = block * kBlockVertices;
  const auto read = [&](uint64_t last) {
    const uint64_t count = std::min(last * kBlockVertices, source_->count()) - first;
    source_->read(first, static_cast<size_t>(count), &untransformed_[3 * first]);
    return last;
  };
  try {
    return read(end);
  } catch (const Error&) {
    if (end == block + 1) throw;
  }
  return read(block + 1);
}

// Reads the vertices of a block from the source, untransformed. If all vertices of the source fit
// in untransformed_, also reads the blocks after it up to a multiple of kBlocksPerRead.
void VertexCache::read(uint64_t block, std::span<double> out) {
  if (is_read_.empty()) return source_->read(block * kBlockVertices, out.size() / 3, out.data());
  if (!is_read_[block]) {
    uint64_t end = block + 1;
    while (end < is_read_.size() && end % kBlocksPerRead != 0 && !is_read_[end]) ++end;
    end = read_blocks(block, end);
    std::fill(is_read_.begin() + static_cast<ptrdiff_t>(block),
              is_read_.begin() + static_cast<ptrdiff_t>(end), true);
  }
  std::copy_n(&untransformed_[3 * block * kBlockVertices], out.size(), out.begin());
}

}  // namespace voxdag
