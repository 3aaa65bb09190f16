// The fast voxelization. Pairs (pairs.h) are expanded only down to pairs of a triangle and a cell
// of 16^3 voxels, and then grouped by tile. One thread block draws the bricks of a tile in shared
// memory (tile_kernel.h). There is no list of voxels, nothing smaller than a cell is sorted, and
// bricks are made in Morton order.
//
// All triangles of the subvolume and their pairs are in memory at the same time. If they do not
// fit, the subvolume is split. The smallest subvolume cannot be split. voxel_list.h voxelizes it
// instead, and reads its triangles in batches.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/backend/parallel/space/brick_list.h"
#include "core/backend/parallel/voxelize/pairs.h"
#include "core/backend/parallel/voxelize/tile_kernel.h"
#include "core/backend/parallel/voxelize/voxel_list.h"

namespace voxdag::parallel {

// Collects all (triangle, cell) pairs of a subvolume, as the `out` of PairExpansion::run().
template <class Space>
class CellPairs {
 public:
  explicit CellPairs(Space& space) : space_(space) {}

  PairSpan span() {
    if (size_ == codes_.size()) grow();
    return {codes_.data() + size_, triangles_.data() + size_,
            static_cast<uint32_t>(codes_.size()) - size_};
  }
  void commit(uint32_t count) { size_ += count; }
  void flush() { grow(); }

  uint32_t size() const { return size_; }
  const uint64_t* codes() const { return codes_.data(); }
  const uint32_t* triangles() const { return triangles_.data(); }

  // Sorts the pairs by tile; codes have `code_bits` bits.
  void sort(int code_bits) {
    if (size_ == 0 || code_bits == kTileCodeBits) return;
    SpaceArray<Space, uint64_t> code_scratch(space_, codes_.size());
    SpaceArray<Space, uint32_t> triangle_scratch(space_, codes_.size());
    space_.sort_pairs(codes_, code_scratch, triangles_, triangle_scratch, size_,
                      {.begin = kTileCodeBits, .end = code_bits});
  }
  // Returns the position of the first pair of each tile, and sets `tile_count` to the number of
  // tiles. Requires sort().
  SpaceArray<Space, uint32_t> tile_starts(uint32_t& tile_count) {
    SpaceArray<Space, uint8_t> flags(space_, size_);
    SpaceArray<Space, uint32_t> starts(space_, size_);
    space_.for_each(size_, MarkFirstOfCube{codes_.data(), kTileCodeBits, flags.data()});
    tile_count = space_.select(flags.data(), size_, starts.data());
    return starts;
  }

 private:
  void grow() {
    const uint64_t size = std::max<uint64_t>(2 * codes_.size(), 1 << 14);
    codes_.grow(space_, size, size_);
    triangles_.grow(space_, size, size_);
  }

  Space& space_;
  uint32_t size_ = 0;
  SpaceArray<Space, uint64_t> codes_;
  SpaceArray<Space, uint32_t> triangles_;
};

template <class Space>
void draw_tiles(Space& space, const SubvolumeTask& task, const FixedTriangle* triangles,
                CellPairs<Space>& pairs, BrickList<Space>& bricks) {
  uint32_t tile_count = 0;
  const SpaceArray<Space, uint32_t> starts = pairs.tile_starts(tile_count);
  constexpr uint64_t kBytesPerTile = kTileBricks * 2 * sizeof(uint64_t);
  const uint32_t wave =
      std::min({tile_count, fitting_count(space, 4, kBytesPerTile, 1), Space::kMaxTiles});
  SpaceArray<Space, uint64_t> codes(space, uint64_t{wave} * kTileBricks);
  SpaceArray<Space, uint64_t> masks(space, uint64_t{wave} * kTileBricks);
  SpaceArray<Space, uint32_t> counts(space, wave + 1);
  for (uint32_t first = 0; first < tile_count; first += wave) {
    const uint32_t blocks = std::min(wave, tile_count - first);
    const auto draw = [&](const auto& kernel) { space.for_each_thread_block(blocks, kernel); };
    const TileWave wave_of_tiles{CubePlace(task), triangles,    pairs.codes(), pairs.triangles(),
                                 starts.data(),   tile_count,   pairs.size(),  first,
                                 codes.data(),    masks.data(), counts.data()};
    if (task.rule == VoxelRule::kThin)
      draw(DrawTile<VoxelRule::kThin>{wave_of_tiles});
    else
      draw(DrawTile<VoxelRule::kShell>{wave_of_tiles});
    space.scan(counts.data(), blocks);
    const uint32_t count = space.value(counts.data() + blocks);
    const uint32_t at = bricks.reserve(count);
    space.expand(counts.data(), 0, blocks, count,
                 MoveBricks{codes.data(), masks.data(), bricks.codes() + at, bricks.masks() + at});
    bricks.commit(count, true);
  }
}

// Fills `bricks` with all bricks that the triangles touch. The subvolume must be at least as large
// as a tile. Throws OutOfBudget if the budget is too small; `bricks` is then undefined.
template <class Space>
void voxelize_by_tiles(Space& space, const SubvolumeTask& task, TriangleStream& stream,
                       BrickList<Space>& bricks) {
  const int cube_levels = static_cast<int>(task.grid_levels - task.cube.level);
  const int depths = cube_levels - kCellLevels;
  SpaceArray<Space, FixedTriangle> triangles(space, stream.count());
  stream.rewind();
  const uint32_t count =
      upload_triangles(space, stream, triangles.data(), static_cast<uint32_t>(triangles.size()));
  CellPairs<Space> pairs(space);
  {
    const uint64_t bytes_each = static_cast<uint64_t>(depths) * PairExpansion<Space>::kBytesPerPair;
    const uint32_t window = std::min<uint32_t>(fitting_count(space, 6, bytes_each, 256),
                                               static_cast<uint32_t>(Space::kWindow));
    PairExpansion<Space> expansion(space, task, depths, false, window);
    for (uint32_t first = 0; first < count; first += window)
      expansion.run(triangles.data(), first, std::min(count, first + window), pairs);
  }
  if (pairs.size() == 0) return;
  pairs.sort(3 * depths);
  draw_tiles(space, task, triangles.data(), pairs, bricks);
}

}  // namespace voxdag::parallel
