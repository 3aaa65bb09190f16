#include "core/backend/cpu/solid/tile_filler.h"

#include <algorithm>
#include <cstring>
#include <iterator>

#include "core/backend/cpu/raster/flood.h"
#include "core/base/popcount8.h"
#include "core/dag/brick.h"
#include "core/geometry/crossing.h"
#include "core/geometry/cube.h"

namespace voxdag::cpu {
namespace {

// Maximum number of blind components (components without a corner, see solid_rule.h) that are
// collected. One pass over the tile's triangles then counts the crossings of the walks to all of
// them.
constexpr size_t kMaxBlind = 256;

// Returns the coordinate, along `axis`, of the cube with the number `index` (below 512) in Morton
// order.
int cube_coordinate(int index, int axis) {
  const int bits = index >> (2 - axis);
  return (bits & 1) | (bits >> 2 & 2) | (bits >> 4 & 4);
}

// Returns the sum of the signs of the triangle's crossings with the walk from `from` to `to`: first
// along z, then along y, then along x.
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
                      const TileViews& views, const int (&origin)[3],
                      const ForEachTriangle& for_each_triangle, FilledVoxels& filled) {
  std::fill(std::begin(full_), std::end(full_), 0);
  list_occupied(tile, size_log2);
  const int top = size_log2 - block_log2_;
  if ((occupied_[top][0] & 1) == 0) return false;
  tile_ = &tile;
  tile_low_ = low;
  views_ = &views;
  origin_ = origin;
  for_each_triangle_ = &for_each_triangle;
  filled_ = &filled;
  for (int level = top; level > 0; --level) fill_empty_children(level);
  fill_blocks();
  fill_blind();
  return true;
}

void TileFiller::list_occupied(const TileBricks& tile, int size_log2) {
  const int top = size_log2 - block_log2_;
  for (auto& words : occupied_) std::fill(std::begin(words), std::end(words), 0);
  for (int i = 0; i < 1 << 3 * top; i += 8) {
    uint64_t touched;
    std::memcpy(&touched, tile.touched + i, sizeof touched);
    if (touched == 0) continue;
    for (int j = 0; j < 8; ++j) {
      if (tile.touched[i + j] == 0) continue;
      uint64_t any = 0;
      for (const uint64_t brick : tile.blocks[i + j].bricks) any |= brick;
      occupied_[0][i / 64] |= uint64_t{any != 0} << (i + j) % 64;
    }
  }
  for (int level = 1; level <= top; ++level)
    for (int w = 0; w < kTileBlocks / 64; ++w)
      occupied_[level][w / 8] |= uint64_t{octants(occupied_[level - 1][w])} << 8 * (w % 8);
}

// `level` is log2 of the edge of the occupied cubes, in blocks.
void TileFiller::fill_empty_children(int level) {
  for (int w = 0; w < kTileBlocks / 64; ++w)
    for (uint64_t rest = occupied_[level][w]; rest != 0; rest &= rest - 1) {
      const int index = 64 * w + lowest_bit(rest);
      const uint32_t children = occupied_[level - 1][index / 8] >> 8 * (index % 8) & 0xff;
      for (uint32_t empty = ~children & 0xff; empty != 0; empty &= empty - 1)
        fill_empty(level - 1, 8 * index + lowest_bit(empty));
    }
}

// Fills an empty cube if it is inside the solid. `index` is the cube's number in Morton order, and
// `level` log2 of its edge in blocks.
void TileFiller::fill_empty(int level, int index) {
  int low[3];
  for (int a = 0; a < 3; ++a) low[a] = origin_[a] + (cube_coordinate(index, a) << level);
  const UnitViews unit = views_->corners_of(low, 1 << level);
  if (!unit.is_inside()) return;
  const int count = 1 << 3 * level;
  if (level < 2)
    full_[index * count / 64] |= ((uint64_t{1} << count) - 1) << index * count % 64;
  else
    std::fill_n(full_ + index * count / 64, count / 64, ~uint64_t{0});
  filled_->add(unit, static_cast<uint64_t>(count) << 3 * block_log2_);
}

void TileFiller::fill_blocks() {
  const auto for_each_block = [&](const auto& visit) {
    for (int w = 0; w < kTileBlocks / 64; ++w)
      for (uint64_t rest = occupied_[0][w]; rest != 0; rest &= rest - 1)
        visit(64 * w + lowest_bit(rest));
  };
  int count = 0;
  for (const uint64_t word : occupied_[0]) count += popcount64(word);
  if (block_log2_ != kBlockLog2 || !memo_.is_worthwhile(count)) {
    for_each_block([&](int index) { fill_block(index); });
    return;
  }
  count = 0;
  for_each_block([&](int index) {
    keys_[count] = block_key(tile_->blocks[index]);
    memo_.prefetch(keys_[count++]);
  });
  count = 0;
  for_each_block([&](int index) { fill_block(index, keys_[count++]); });
}

void TileFiller::fill_block(int index) {
  const VoxelBlock& block = tile_->blocks[index];
  int low[3];
  position_of(index, low);
  int32_t classes[8];
  views_->classes_at(low, classes);
  if (block_log2_ == kBlockLog2)
    kernels_.find_components(block, classes, components_);
  else
    find_components_with<kBrickEdge - 1>(block, classes, components_);
  fill_components(index, low);
}

void TileFiller::fill_block(int index, uint64_t key) {
  VoxelBlock& block = tile_->blocks[index];
  int low[3];
  position_of(index, low);
  if (const UnitsMemo::Units* units = memo_.find(key, block)) {
    fill_units(*units, low, block);
    return;
  }
  memo_.count_miss();
  // All corners get different classes, so that find_components() makes a separate entry for each
  // component. See BlockComponents in slices.h.
  constexpr int32_t kClasses[8] = {0, 1, 2, 3, 4, 5, 6, 7};
  kernels_.find_components(block, kClasses, components_);
  insert_units(key, block);
  fill_components(index, low);
}

void TileFiller::fill_components(int index, const int (&low)[3]) {
  for (int i = 0; i < components_.count; ++i) {
    uint32_t corners = components_.corners[i];
    UnitViews unit;
    if (components_.is_alike[i])
      unit.add(view_at(low, lowest_bit(corners)));
    else
      for (; corners != 0; corners &= corners - 1) unit.add(view_at(low, lowest_bit(corners)));
    if (unit.is_inside())
      filled_->add(unit, kernels_.add_slices(components_.voxels[i], tile_->blocks[index]));
  }
  if (components_.rest.any()) add_blind(index, low, components_.rest);
}

void TileFiller::fill_units(const UnitsMemo::Units& units, const int (&low)[3], VoxelBlock& block) {
  int32_t views[8];
  views_->at_corners(low, views);
  bool is_inside[2];
  for (int u = 0; u < 2; ++u) {
    UnitViews unit{0, popcount8(units.corners[u])};
    for (int c = 0; c < 8; ++c) unit.sum += views[c] & -(units.corners[u] >> c & 1);
    is_inside[u] = unit.is_inside();
    if (is_inside[u]) filled_->add(unit, units.voxels[u]);
  }
  if (!is_inside[0] && !is_inside[1]) return;
  const uint64_t all = is_inside[0] && is_inside[1] ? ~uint64_t{0} : 0;
  const uint64_t flipped = is_inside[0] ? 0 : ~uint64_t{0};
  for (int i = 0; i < kBlockBricks; ++i) block.bricks[i] |= (units.first.bricks[i] ^ flipped) | all;
}

void TileFiller::insert_units(uint64_t key, const VoxelBlock& block) {
  const int count = components_.count;
  if (count == 0 || count > 2 || components_.rest.any()) return;
  UnitsMemo::Units units{};
  if (count == 2) {
    units.voxels[0] =
        static_cast<uint16_t>(kernels_.add_slices(components_.voxels[0], units.first));
    units.corners[0] = static_cast<uint8_t>(components_.corners[0]);
  }
  units.voxels[1] = static_cast<uint16_t>(components_.empty_voxels - units.voxels[0]);
  units.corners[1] = static_cast<uint8_t>(components_.corners[count - 1]);
  memo_.insert(key, block, units);
}

void TileFiller::position_of(int index, int (&low)[3]) const {
  for (int a = 0; a < 3; ++a) low[a] = origin_[a] + cube_coordinate(index, a);
}

int32_t TileFiller::view_at(const int (&block)[3], int corner) const {
  return views_->at(block[0] + child_coordinate(corner, 0), block[1] + child_coordinate(corner, 1),
                    block[2] + child_coordinate(corner, 2));
}

void TileFiller::add_blind(int index, const int (&low)[3], Slices& rest) {
  while (rest.any()) {
    VoxelBlock order{};
    kernels_.add_slices(rest, order);
    int brick = 0;
    while (order.bricks[brick] == 0) ++brick;
    const int bit = lowest_bit(order.bricks[brick]);
    int64_t k[3];
    for (int a = 0; a < 3; ++a)
      k[a] = brick_coordinate(bit, a) + kBrickEdge * child_coordinate(brick, a);
    BlindComponent blind;
    blind.block = index;
    blind.voxels.x[k[0]] = uint64_t{1} << (8 * k[1] + k[2]);
    kernels_.flood(rest, blind.voxels);
    rest.remove(blind.voxels);
    for (int a = 0; a < 3; ++a) {
      blind.from[a] = tile_low_[a] + (int64_t{low[a] - origin_[a]} << (kUnitBits + block_log2_));
      blind.to[a] = blind.from[a] + k[a] * kUnitsPerVoxel + kUnitsPerVoxel / 2;
    }
    blind.views = view_at(low, 0);
    blind.crossings = 0;
    if (blind_.size() == kMaxBlind) fill_blind();
    blind_.push_back(blind);
  }
}

void TileFiller::fill_blind() {
  if (blind_.empty()) return;
  (*for_each_triangle_)([&](const FixedTriangle& triangle) {
    int64_t low[3], high[3];
    for (int a = 0; a < 3; ++a) {
      low[a] = triangle.low(a);
      high[a] = triangle.high(a);
    }
    for (BlindComponent& blind : blind_) {
      bool is_near = true;
      for (int a = 0; a < 3; ++a) is_near &= low[a] <= blind.to[a] && high[a] >= blind.from[a];
      if (is_near) blind.crossings += walk_crossings(triangle, blind.from, blind.to);
    }
  });
  for (const BlindComponent& blind : blind_) {
    const UnitViews unit{views_after(rule_, blind.views, blind.crossings), 1};
    if (!unit.is_inside()) continue;
    filled_->add(unit, kernels_.add_slices(blind.voxels, tile_->blocks[blind.block]));
  }
  blind_.clear();
}

}  // namespace voxdag::cpu
