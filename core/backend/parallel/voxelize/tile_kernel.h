// Draws the bricks of one tile of 64^3 voxels with one thread block. The thread block's shared
// memory contains the masks of the tile's 4096 bricks. All triangles of the tile are drawn into
// these masks. Then the bricks that are not empty are written in Morton order.
//
// The unit of work is a (triangle, cell) pair; the cell is a cube of 16^3 voxels that the triangle
// touches. One thread finds the bricks of the cell that the triangle touches, and then the voxels
// of each brick. Masks are combined by OR, so the result does not depend on the order of the pairs.
#pragma once

#include <cstdint>

#include "core/backend/parallel/space/thread_block.h"
#include "core/backend/parallel/voxelize/pairs.h"
#include "core/backend/parallel/voxelize/triangle_cells.h"

namespace voxdag::parallel {

inline constexpr int kTileLevels = 6;  // log2 of a tile's edge in voxels
inline constexpr int kCellLevels = 4;  // log2 of a cell's edge
inline constexpr uint32_t kTileBricks = 1u << 3 * (kTileLevels - kBrickLevels);
inline constexpr int kTileCodeBits =
    3 * (kTileLevels - kCellLevels);  // bits of a cell's code within its tile

// The pairs of all tiles, and output arrays for a wave: the tiles from `first_tile` on that are
// drawn concurrently, each by one thread block.
struct TileWave {
  CubePlace place;
  const FixedTriangle* triangles;
  const uint64_t* codes;  // codes of the pairs' cells, sorted by tile
  const uint32_t* pair_triangles;
  const uint32_t* tile_starts;  // index of the first pair of each tile
  uint32_t tile_count, pair_count, first_tile;

  // The output arrays have space for kTileBricks bricks per thread block. Each thread block writes
  // its number of bricks to `brick_counts`.
  uint64_t* brick_codes;
  uint64_t* brick_masks;
  uint32_t* brick_counts;
};

template <VoxelRule kRule>
struct DrawTile : TileWave {
  static constexpr uint32_t kThreads = 256;
  static constexpr int kMinResidentBlocks = 2;
  static constexpr int kPhases = 5;
  // A thread's run: this many consecutive bricks, which the thread counts and writes.
  static constexpr uint32_t kRun = kTileBricks / kThreads;
  static constexpr uint32_t kGroup = 16;  // number of threads whose counts one thread adds up

  struct Shared {
    uint64_t masks[kTileBricks + kThreads];  // indexed by slot()
    uint32_t counts[kThreads];               // non-empty bricks in each thread's run
    uint32_t groups[kThreads / kGroup];      // sums of `counts` over groups of threads
  };
  // Returns the index of a brick in `masks`. There is one word of padding after each thread's run
  // of bricks, so that neighboring threads use different banks of the shared memory.
  VOXDAG_HD static uint32_t slot(uint32_t brick) { return brick + brick / kRun; }

  VOXDAG_HD void operator()(int phase, uint32_t block, uint32_t thread, Shared& shared) const {
    switch (phase) {
      case 0:
        for (uint32_t i = thread; i < kTileBricks + kThreads; i += kThreads) shared.masks[i] = 0;
        return;
      case 1:
        return draw_pairs(first_tile + block, thread, shared);
      case 2:
        return count_run(thread, shared);
      case 3:
        return sum_group(thread, shared);
      default:
        return write_run(block, thread, shared);
    }
  }

  VOXDAG_HD void draw_pairs(uint32_t tile, uint32_t thread, Shared& shared) const {
    const uint32_t end = tile + 1 < tile_count ? tile_starts[tile + 1] : pair_count;
    for (uint32_t pair = tile_starts[tile] + thread; pair < end; pair += kThreads)
      draw(triangles[pair_triangles[pair]], codes[pair], shared);
  }

  VOXDAG_HD void draw(const FixedTriangle& triangle, uint64_t cell, Shared& shared) const {
    constexpr int kBrickShift = kUnitBits + kBrickLevels;
    int64_t low[3];
    place.low(cell, kUnitBits + kCellLevels, low);
    const uint64_t bricks = touched_cells<4>(triangle, low, kBrickShift);
    const uint32_t first = static_cast<uint32_t>(cell % (kTileBricks / 64)) * 64;
    if (kRule == VoxelRule::kThin || !is_narrow(triangle))
      return draw_by_brick(triangle, low, bricks, first, shared);
    const TriangleOnLattice on_voxels(triangle, low, kUnitBits);
    for (uint64_t left = bricks; left != 0; left &= left - 1) {
      const int brick = lowest_bit(left);
      int at[3];
      for (int a = 0; a < 3; ++a) at[a] = kBrickEdge * brick_coordinate(brick, a);
      draw(on_voxels.touched<4>(at), first + static_cast<uint32_t>(brick), shared);
    }
  }
  VOXDAG_HD void draw_by_brick(const FixedTriangle& triangle, const int64_t (&low)[3],
                               uint64_t bricks, uint32_t first, Shared& shared) const {
    constexpr int kBrickShift = kUnitBits + kBrickLevels;
    for (; bricks != 0; bricks &= bricks - 1) {
      const int brick = lowest_bit(bricks);
      int64_t brick_low[3];
      for (int a = 0; a < 3; ++a)
        brick_low[a] = low[a] + (static_cast<int64_t>(brick_coordinate(brick, a)) << kBrickShift);
      draw(voxels_of_brick(triangle, brick_low), first + static_cast<uint32_t>(brick), shared);
    }
  }
  VOXDAG_HD static uint64_t voxels_of_brick(const FixedTriangle& triangle,
                                            const int64_t (&low)[3]) {
    if constexpr (kRule == VoxelRule::kThin)
      return crossed_voxels(triangle, low);
    else
      return touched_cells<4>(triangle, low, kUnitBits);
  }
  VOXDAG_HD void draw(uint64_t voxels, uint32_t brick, Shared& shared) const {
    or_shared(shared.masks[slot(brick)], voxels);
  }

  VOXDAG_HD void count_run(uint32_t thread, Shared& shared) const {
    uint32_t count = 0;
    for (uint32_t i = 0; i < kRun; ++i) count += shared.masks[slot(thread * kRun + i)] != 0;
    shared.counts[thread] = count;
  }

  VOXDAG_HD void sum_group(uint32_t thread, Shared& shared) const {
    if (thread >= kThreads / kGroup) return;
    uint32_t sum = 0;
    for (uint32_t i = 0; i < kGroup; ++i) sum += shared.counts[thread * kGroup + i];
    shared.groups[thread] = sum;
  }

  VOXDAG_HD void write_run(uint32_t block, uint32_t thread, const Shared& shared) const {
    uint32_t at = 0;
    for (uint32_t g = 0; g < thread / kGroup; ++g) at += shared.groups[g];
    for (uint32_t t = thread / kGroup * kGroup; t < thread; ++t) at += shared.counts[t];
    if (thread == kThreads - 1) brick_counts[block] = at + shared.counts[thread];
    const uint64_t tile_code = codes[tile_starts[first_tile + block]] >> kTileCodeBits;
    for (uint32_t i = 0; i < kRun; ++i) {
      const uint32_t brick = thread * kRun + i;
      const uint64_t mask = shared.masks[slot(brick)];
      if (mask == 0) continue;
      brick_codes[uint64_t{block} * kTileBricks + at] = tile_code * kTileBricks + brick;
      brick_masks[uint64_t{block} * kTileBricks + at++] = mask;
    }
  }
};

// Copies the bricks of each thread block to the list of all bricks.
struct MoveBricks {
  const uint64_t* codes;
  const uint64_t* masks;
  uint64_t* out_codes;
  uint64_t* out_masks;
  VOXDAG_HD void operator()(uint32_t block, uint32_t rank, uint32_t output) const {
    const uint64_t from = uint64_t{block} * kTileBricks + rank;
    out_codes[output] = codes[from];
    out_masks[output] = masks[from];
  }
};

}  // namespace voxdag::parallel
