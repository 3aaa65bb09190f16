#include <algorithm>
#include <utility>

#include "core/backend/cpu/raster/flood.h"
#include "core/backend/cpu/raster/kernels.h"
#include "core/backend/cpu/raster/octant_test.h"

namespace voxdag::cpu {
namespace {

struct PlainQuad {
  double x[4];

  explicit PlainQuad(double all) : x{all, all, all, all} {}
  PlainQuad(double x0, double x1, double x2, double x3) : x{x0, x1, x2, x3} {}
  template <class Coordinate>
  static PlainQuad load(const Coordinate (&v)[3], int64_t origin) {
    return {static_cast<double>(v[0] - origin), static_cast<double>(v[1] - origin),
            static_cast<double>(v[2] - origin), 0.0};
  }
  PlainQuad operator+(const PlainQuad& o) const {
    return {x[0] + o.x[0], x[1] + o.x[1], x[2] + o.x[2], x[3] + o.x[3]};
  }
  PlainQuad operator-(const PlainQuad& o) const {
    return {x[0] - o.x[0], x[1] - o.x[1], x[2] - o.x[2], x[3] - o.x[3]};
  }
  PlainQuad operator*(const PlainQuad& o) const {
    return {x[0] * o.x[0], x[1] * o.x[1], x[2] * o.x[2], x[3] * o.x[3]};
  }
  PlainQuad rotated() const { return {x[1], x[2], x[0], x[3]}; }
  PlainQuad clamp_to_zero() const {
    PlainQuad out(0.0);
    for (int i = 0; i < 4; ++i) out.x[i] = x[i] > 0 ? x[i] : 0;
    return out;
  }
  uint32_t negative() const {
    uint32_t bits = 0;
    for (int i = 0; i < 4; ++i) bits |= (x[i] < 0 ? 1u : 0u) << i;
    return bits;
  }
};

Octants test_octants_narrow(const NarrowTriangle& triangle, const LatticeCube& cube, bool inside) {
  return OctantTest<PlainQuad, int32_t>(triangle, cube).run(inside);
}

int list_blocks(TileBricks& tile, int groups, uint8_t* existing, uint16_t* numbers,
                uint64_t* keys) {
  int count = 0;
  for (int group = 0; group < groups; ++group) {
    uint32_t bits = 0;
    for (int i = 0; i < 8; ++i) {
      const int number = 8 * group + i;
      if (!std::exchange(tile.touched[number], 0)) continue;
      const VoxelBlock& block = tile.blocks[number];
      if (std::all_of(block.bricks, block.bricks + kBlockBricks, [](uint64_t b) { return b == 0; }))
        continue;
      bits |= 1u << i;
      numbers[count] = static_cast<uint16_t>(number);
      keys[count++] = block_key(block);
    }
    existing[group] = static_cast<uint8_t>(bits);
  }
  return count;
}

VoxelBlockContent unpack(const VoxelBlock& block, uint64_t* bricks) {
  VoxelBlockContent content{0, 0};
  for (int i = 0; i < kBlockBricks; ++i) {
    if (block.bricks[i] == 0) continue;
    content.mask |= 1u << i;
    content.voxels += static_cast<uint32_t>(popcount64(block.bricks[i]));
    *bricks++ = block.bricks[i];
  }
  return content;
}

void find_in_range(const int64_t* values, int count, int64_t low, int64_t high, uint64_t* bits) {
  for (int i = 0; i < count; i += 64) {
    uint64_t word = 0;
    for (int j = 0; j < 64 && i + j < count; ++j)
      word |= uint64_t{values[i + j] >= low && values[i + j] <= high} << j;
    bits[i / 64] = word;
  }
}

void find_components(const VoxelBlock& block, const int32_t (&classes)[8], BlockComponents& out) {
  find_components_with<7>(block, classes, out);
}

void flood(const Slices& empty, Slices& reached) { flood_with(empty, reached); }

uint32_t add_slices(const Slices& voxels, VoxelBlock& block) {
  return add_slices_with(voxels, block);
}

constexpr Kernels kPortable = {"portable",
                               draw_exactly<int32_t>,
                               draw_thin_exactly<int32_t>,
                               test_octants_narrow,
                               find_in_range,
                               list_blocks,
                               unpack,
                               find_components,
                               flood,
                               add_slices};

}  // namespace

const Kernels& portable_kernels() { return kPortable; }
#ifndef __x86_64__
const Kernels* avx2_kernels() { return nullptr; }
const Kernels* avx512_kernels() { return nullptr; }
#endif

Octants test_octants_wide(const WideTriangle& triangle, const LatticeCube& cube, bool inside) {
  return OctantTest<PlainQuad, int64_t>(triangle, cube).run(inside);
}

}  // namespace voxdag::cpu
