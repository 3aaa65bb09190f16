// Fills the voxels of a tile that are inside a solid (core/geometry/solid_rule.h). At first the
// tile has only the voxels of the shell. A unit is filled completely or not at all. The units of a
// tile are its maximal empty cubes, and the components of the empty voxels in blocks that have
// voxels of the shell. Not thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "core/backend/cpu/raster/kernels.h"
#include "core/backend/cpu/raster/slices.h"
#include "core/backend/cpu/raster/tile_bricks.h"
#include "core/backend/cpu/solid/tile_views.h"
#include "core/backend/cpu/solid/units_memo.h"
#include "core/geometry/fixed_triangle.h"

namespace voxdag::cpu {

// Counts voxels whose units (core/geometry/solid_rule.h) are inside the solid.
struct FilledVoxels {
  uint64_t filled = 0;
  uint64_t disputed = 0;  // voxels of `filled` whose unit is_disputed()

  void add(const UnitViews& unit, uint64_t voxels) {
    filled += voxels;
    if (unit.is_disputed()) disputed += voxels;
  }
};

class TileFiller {
 public:
  // A function that calls its argument for each triangle of the tile.
  using ForEachTriangle = std::function<void(const std::function<void(const FixedTriangle&)>&)>;

  TileFiller(const Kernels& kernels, SolidRule rule, uint32_t grid_levels, PooledMemory& memory)
      : kernels_(kernels), rule_(rule), block_log2_(solid_block_log2(grid_levels)), memo_(memory) {}

  // Fills a tile, or a cube within a tile, with an edge of 2^size_log2 voxels. `low` is its low
  // corner in lattice units, and `origin` its position in `views`, in blocks. Returns false,
  // without filling, if the cube has no voxel of the shell. Leaves the blocks of full_blocks()
  // empty.
  bool fill(TileBricks& tile, int size_log2, const int64_t (&low)[3], const TileViews& views,
            const int (&origin)[3], const ForEachTriangle& for_each_triangle, FilledVoxels& filled);
  // Returns the blocks of the empty cubes that are inside the solid, as a bit set in Morton order.
  const uint64_t* full_blocks() const { return full_; }

 private:
  // A component of empty voxels without a corner of its block, and the walk to it. The walk begins
  // at the block's low corner. It goes along z, then y, then x, to the center of the component's
  // first voxel in Morton order.
  struct BlindComponent {
    int block;  // index in TileBricks
    Slices voxels;
    int64_t from[3], to[3];
    int64_t views;      // sum of the views from the block's low corner
    int64_t crossings;  // sum of the signs of the walk's crossings
  };

  void list_occupied(const TileBricks& tile, int size_log2);
  // Finds the empty children of the occupied cubes of a level, and fills those inside the solid.
  void fill_empty_children(int level);
  void fill_empty(int level, int index);
  void fill_blocks();
  void fill_block(int index);
  // fill_block() with the memo. `key`: block_key() of the block.
  void fill_block(int index, uint64_t key);
  // Fills the units in components_, which are the units of a block that is not in the memo.
  void fill_components(int index, const int (&low)[3]);
  // Fills the units of a block at the position `low` (in blocks) that are inside the solid.
  void fill_units(const UnitsMemo::Units& units, const int (&low)[3], VoxelBlock& block);
  // Adds the block and its units, which are in components_, to the memo if the memo accepts them.
  void insert_units(uint64_t key, const VoxelBlock& block);
  // Sets `low` to the position of a block in views_, in blocks.
  void position_of(int index, int (&low)[3]) const;
  // Returns the sum of the views from a corner of the block at the position `block` (in blocks).
  int32_t view_at(const int (&block)[3], int corner) const;
  // Adds to blind_ the components of `rest`, a set of empty voxels of the block with the number
  // `index` and the position `low` (in blocks). Makes `rest` empty.
  void add_blind(int index, const int (&low)[3], Slices& rest);
  void fill_blind();

  const Kernels& kernels_;
  const SolidRule rule_;
  const int block_log2_;
  // occupied_[level] is a bit set, in Morton order, of the cubes with voxels. `level` is log2 of
  // the cubes' edge in blocks.
  uint64_t occupied_[4][kTileBlocks / 64];
  uint64_t full_[kTileBlocks / 64];
  std::vector<BlindComponent> blind_;
  BlockComponents components_;
  UnitsMemo memo_;
  uint64_t keys_[kTileBlocks];  // block_key() of each block with voxels
  // Arguments of fill().
  TileBricks* tile_ = nullptr;
  const int64_t* tile_low_ = nullptr;
  const TileViews* views_ = nullptr;
  const int* origin_ = nullptr;
  const ForEachTriangle* for_each_triangle_ = nullptr;
  FilledVoxels* filled_ = nullptr;
};

}  // namespace voxdag::cpu
