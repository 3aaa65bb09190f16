// Columns of bricks in a tile, along the axis D of the normal's largest component, and the
// positions of their bricks and voxels.
//
// Only included by sources compiled for AVX2 or AVX-512; everything has internal linkage.
#pragma once

#include <immintrin.h>

#include <cstdint>

#include "core/backend/cpu/raster/tile_bricks.h"
#include "core/dag/brick.h"

#define VOXDAG_INLINE __attribute__((always_inline)) inline

namespace voxdag::cpu {
namespace {

// kP and kQ are the two axes across columns that are parallel to axis D. p and q are the
// coordinates along these axes. The number of a voxel column in its column of bricks has, from bit
// 0 on: the low bit of p, the low bit of q, the high bit of p, and the high bit of q. kQ is chosen
// so that the high bit of q is one of the two highest bits of a voxel's bit number in its brick.
template <int D>
constexpr int kP = D == 2 ? 0 : 2;
template <int D>
constexpr int kQ = D == 1 ? 0 : 1;

constexpr int column_p(int column) { return (column & 1) | (column >> 1 & 2); }
constexpr int column_q(int column) { return (column >> 1 & 1) | (column >> 2 & 2); }

// voxels[axis][k] has the voxels of a brick whose coordinate along the axis is k.
struct Layers {
  uint64_t voxels[3][4] = {};
  constexpr Layers() {
    for (int voxel = 0; voxel < 64; ++voxel)
      for (int axis = 0; axis < 3; ++axis)
        voxels[axis][brick_coordinate(voxel, axis)] |= uint64_t{1} << voxel;
  }
};
constexpr Layers kLayers;

// Columns of bricks, numbered p + 16 q. The columns of all rows are in one list, because the CPU
// would mispredict the length of a separate loop for each row.
struct ColumnList {
  int count = 0;
  uint8_t numbers[256 + 16];  // 16 spare elements, because add() always writes 16 numbers

  // Adds the columns of bricks `first` to `last` of row q, 0 <= first <= last + 1 <= 16. Adds none
  // if first = last + 1.
  VOXDAG_INLINE void add(int q, int first, int last) {
    const __m128i steps = _mm_setr_epi8(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    _mm_storeu_si128(reinterpret_cast<__m128i*>(numbers + count),
                     _mm_add_epi8(steps, _mm_set1_epi8(static_cast<int8_t>(16 * q + first))));
    count += last - first + 1;
  }
  template <class Visit>
  VOXDAG_INLINE void for_each(Visit visit) const {
    for (int i = 0; i < count; ++i) visit(int{numbers[i]});
  }
};

// The two parts of a brick's Morton index in the tile: one for the number of its column of bricks,
// and one for its height in the column.
template <int D>
struct BrickIndex {
  uint16_t of_column[256] = {};
  uint16_t of_height[16] = {};
  constexpr BrickIndex() {
    for (int i = 0; i < 256; ++i)
      of_column[i] =
          static_cast<uint16_t>(kSpread[i % 16] << (2 - kP<D>) | kSpread[i / 16] << (2 - kQ<D>));
    for (int z = 0; z < 16; ++z) of_height[z] = static_cast<uint16_t>(kSpread[z] << (2 - D));
  }
};
template <int D>
inline constexpr BrickIndex<D> kBrickIndex;

// Returns a set of 4 x 4 voxel columns, in Morton order, with the two axes exchanged.
VOXDAG_INLINE uint32_t transposed(uint32_t columns) {
  const uint32_t low = (columns >> 1 ^ columns) & 0x2222;
  columns ^= low | low << 1;
  const uint32_t high = (columns >> 4 ^ columns) & 0x00f0;
  return columns ^ (high | high << 4);
}

}  // namespace
}  // namespace voxdag::cpu
