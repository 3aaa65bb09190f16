#include "core/backend/cpu/solid/tile_filler.h"

#include <algorithm>

#include "core/dag/brick.h"
#include "core/geometry/crossing.h"
#include "core/geometry/cube.h"

namespace voxdag::cpu {
namespace {

// Max blind components (solid_rule.h) that are collected before one pass over the tile's triangles
// computes the walks to all of them.
constexpr size_t kMaxBlind = 256;

uint64_t count_voxels(const Slices& slices) {
  uint64_t count = 0;
  for (const uint64_t word : slices.x) count += static_cast<uint64_t>(popcount64(word));
  return count;
}

void add_voxels(const Slices& voxels, VoxelBlock& block) {
  const VoxelBlock added = block_of(voxels);
  for (int i = 0; i < kBlockBricks; ++i) block.bricks[i] |= added.bricks[i];
}

// Returns the sum of the signs of the triangle's crossings with the walk.
int64_t walk_crossings(const FixedTriangle& t, const int64_t (&from)[3], const int64_t (&to)[3]) {
  int64_t p[3] = {from[0], from[1], from[2]};
  int64_t sum = 0;
  for (int a = 2; a >= 0; --a) {
    sum += leg_crossing(t, p, a, to[a] - from[a]);
    p[a] = to[a];
  }
  return sum;
}

}  // namespace

bool TileFiller::fill(TileBricks& tile, int size_log2, const int64_t (&low)[3],
                      const TileViews& views, const ForEachTriangle& for_each_triangle,
                      FilledVoxels& filled) {
  list_occupied(tile, size_log2);
  const int top = size_log2 - block_log2_;
  if (!is_occupied(top, 0)) return false;
  tile_ = &tile;
  tile_low_ = low;
  views_ = &views;
  for_each_triangle_ = &for_each_triangle;
  filled_ = &filled;
  fill_cube(top, 0, {0, 0, 0});
  fill_blind();
  return true;
}

void TileFiller::list_occupied(const TileBricks& tile, int size_log2) {
  const int top = size_log2 - block_log2_;
  const int count = 1 << 3 * top;
  for (auto& words : occupied_) std::fill(std::begin(words), std::end(words), 0);
  for (int i = 0; i < count; ++i) {
    if (tile.touched[i] == 0) continue;
    uint64_t any = 0;
    for (const uint64_t brick : tile.blocks[i].bricks) any |= brick;
    occupied_[0][i / 64] |= uint64_t{any != 0} << i % 64;
  }
  for (int level = 1; level <= top; ++level)
    for (int w = 0; w < kTileBlocks / 64; ++w)
      occupied_[level][w / 8] |= uint64_t{octants(occupied_[level - 1][w])} << 8 * (w % 8);
}

bool TileFiller::is_occupied(int level, int index) const {
  return occupied_[level][index / 64] >> index % 64 & 1;
}

// `level` is log2 of the cube's edge in blocks, `index` its number in Morton order, `low` its
// position in blocks.
void TileFiller::fill_cube(int level, int index, const int (&low)[3]) {
  if (!is_occupied(level, index)) {
    const UnitViews unit = views_->corners_of(low, 1 << level);
    if (!unit.is_inside()) return;
    const int count = 1 << 3 * level;
    for (int i = index * count; i < (index + 1) * count; ++i) {
      std::fill(std::begin(tile_->blocks[i].bricks), std::end(tile_->blocks[i].bricks),
                ~uint64_t{0});
      tile_->touched[i] = 1;
    }
    filled_->add(unit, static_cast<uint64_t>(count) << 3 * block_log2_);
    return;
  }
  if (level == 0) return fill_block(index, low);
  const int half = 1 << (level - 1);
  for (int c = 0; c < 8; ++c)
    fill_cube(level - 1, 8 * index + c,
              {low[0] + child_coordinate(c, 0) * half, low[1] + child_coordinate(c, 1) * half,
               low[2] + child_coordinate(c, 2) * half});
}

void TileFiller::fill_block(int index, const int (&low)[3]) {
  VoxelBlock& block = tile_->blocks[index];
  FillMemo::Views views;
  for (int c = 0; c < 8; ++c)
    views.of[c] = views_->at(low[0] + child_coordinate(c, 0), low[1] + child_coordinate(c, 1),
                             low[2] + child_coordinate(c, 2));
  const FillMemo::Filled* known = memo_.find(block, views);
  FillMemo::Filled result{block, 0, 0};
  if (known == nullptr) {
    const Slices shell = slices_of(block);
    const int edge = 1 << block_log2_;
    const uint64_t square = block_log2_ == kBlockLog2 ? ~uint64_t{0} : 0x0f0f0f0full;
    Slices rest;
    for (int x = 0; x < edge; ++x) rest.x[x] = ~shell.x[x] & square;
    fill_components(views, rest, result);
    if (rest.any())
      add_blind(index, low, rest);
    else
      memo_.insert(block, views, result);
    known = &result;
  }
  block = known->block;
  filled_->filled += known->filled;
  filled_->disputed += known->disputed;
}

void TileFiller::fill_components(const FillMemo::Views& views, Slices& rest,
                                 FillMemo::Filled& result) const {
  const int last = (1 << block_log2_) - 1;  // coordinate of the voxels at the high faces
  const auto position = [&](int c) {
    return (8 * child_coordinate(c, 1) + child_coordinate(c, 2)) * last;
  };
  FilledVoxels filled;
  for (int c = 0; c < 8; ++c) {
    const int x = child_coordinate(c, 0) * last;
    const uint64_t bit = uint64_t{1} << position(c);
    if ((rest.x[x] & bit) == 0) continue;
    Slices component;
    component.x[x] = bit;
    component = flood(component, rest);
    UnitViews unit;
    for (int d = c; d < 8; ++d)
      if (component.x[child_coordinate(d, 0) * last] >> position(d) & 1) unit.add(views.of[d]);
    for (int i = 0; i < 8; ++i) rest.x[i] &= ~component.x[i];
    if (!unit.is_inside()) continue;
    add_voxels(component, result.block);
    filled.add(unit, count_voxels(component));
  }
  result.filled = static_cast<uint16_t>(filled.filled);
  result.disputed = static_cast<uint16_t>(filled.disputed);
}

void TileFiller::add_blind(int index, const int (&low)[3], Slices& rest) {
  while (rest.any()) {
    const VoxelBlock order = block_of(rest);
    int brick = 0;
    while (order.bricks[brick] == 0) ++brick;
    const int bit = lowest_bit(order.bricks[brick]);
    int64_t k[3];
    for (int a = 0; a < 3; ++a)
      k[a] = brick_coordinate(bit, a) + kBrickEdge * child_coordinate(brick, a);
    BlindComponent blind;
    blind.block = index;
    Slices seed;
    seed.x[k[0]] = uint64_t{1} << (8 * k[1] + k[2]);
    blind.voxels = flood(seed, rest);
    for (int i = 0; i < 8; ++i) rest.x[i] &= ~blind.voxels.x[i];
    for (int a = 0; a < 3; ++a) {
      blind.from[a] = tile_low_[a] + (int64_t{low[a]} << (kUnitBits + block_log2_));
      blind.to[a] = blind.from[a] + k[a] * kUnitsPerVoxel + kUnitsPerVoxel / 2;
    }
    blind.views = views_->at(low[0], low[1], low[2]);
    blind.crossings = 0;
    if (blind_.size() == kMaxBlind) fill_blind();
    blind_.push_back(blind);
  }
}

void TileFiller::fill_blind() {
  if (blind_.empty()) return;
  (*for_each_triangle_)([&](const FixedTriangle& triangle) {
    for (BlindComponent& blind : blind_)
      blind.crossings += walk_crossings(triangle, blind.from, blind.to);
  });
  for (const BlindComponent& blind : blind_) {
    const UnitViews unit{views_after(rule_, blind.views, blind.crossings), 1};
    if (!unit.is_inside()) continue;
    add_voxels(blind.voxels, tile_->blocks[blind.block]);
    filled_->add(unit, count_voxels(blind.voxels));
  }
  blind_.clear();
}

}  // namespace voxdag::cpu
