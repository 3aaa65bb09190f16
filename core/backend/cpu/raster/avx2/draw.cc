// The rasterizer of draw_by_columns.h for AVX2. The voxels of a brick are the bytes of two vectors.
#include <immintrin.h>

#include "core/backend/cpu/raster/avx2/draw_by_columns.h"
#include "core/backend/cpu/raster/avx2/thin_by_columns.h"
#include "core/backend/cpu/raster/kernels.h"

namespace voxdag::cpu {
namespace {

// Tables with an element for each of a brick's 64 voxels, as bytes of two vectors. tile_columns.h
// defines the number of a voxel column. Bit 5 of the voxel's bit number (core/dag/brick.h) selects
// the vector, and bit 4 the half of the vector.
template <int D>
struct ByteOrder {
  alignas(32) int8_t column[2][32] = {};     // lower three bits of the voxel column's number
  alignas(32) int8_t height[4][2][32] = {};  // height above the floor of the first of four bricks
  alignas(32) int8_t depth[4][2][32] = {};   // distance below the highest voxel of the four bricks
  constexpr ByteOrder() {
    for (int voxel = 0; voxel < 64; ++voxel) {
      const int p = brick_coordinate(voxel, kP<D>), q = brick_coordinate(voxel, kQ<D>);
      column[voxel / 32][voxel % 32] = static_cast<int8_t>((p & 1) | (q & 1) << 1 | (p & 2) << 1);
      for (int brick = 0; brick < 4; ++brick) {
        const int z = 4 * brick + brick_coordinate(voxel, D);
        height[brick][voxel / 32][voxel % 32] = static_cast<int8_t>(z);
        depth[brick][voxel / 32][voxel % 32] = static_cast<int8_t>(kMaxHeight - z);
      }
    }
  }
};
template <int D>
inline constexpr ByteOrder<D> kByteOrder;

// Copies the HeightBounds (sides.h) of a column of bricks to the 64 voxels of a brick. For each
// voxel, a byte of below_ and a byte of over_ have the bounds of its voxel column.
template <int D>
class Spread {
 public:
  // The high bit of a voxel column's coordinate q (tile_columns.h) selects the half of `bounds`
  // that has the bounds of the voxel column. For D = 1, this bit also selects the vector that has
  // the voxels of the voxel column. Otherwise it selects the half of each vector.
  VOXDAG_INLINE explicit Spread(HeightBounds bounds) {
    const __m256i halves[2] = {D == 1 ? _mm256_permute4x64_epi64(bounds, 0x44) : bounds,
                               D == 1 ? _mm256_permute4x64_epi64(bounds, 0xee) : bounds};
    for (int i = 0; i < 2; ++i) {
      const __m256i order = load(kByteOrder<D>.column[i]);
      below_[i] = _mm256_shuffle_epi8(halves[i], order);
      over_[i] = _mm256_shuffle_epi8(halves[i], _mm256_add_epi8(order, _mm256_set1_epi8(8)));
    }
  }
  VOXDAG_INLINE uint64_t mask(int64_t up) const {
    uint32_t half[2];
    for (int i = 0; i < 2; ++i) {
      const __m256i z = load(kByteOrder<D>.height[up][i]);
      const __m256i depth = load(kByteOrder<D>.depth[up][i]);
      half[i] = static_cast<uint32_t>(_mm256_movemask_epi8(_mm256_andnot_si256(
          _mm256_cmpgt_epi8(over_[i], depth), _mm256_cmpgt_epi8(z, below_[i]))));
    }
    return half[0] | static_cast<uint64_t>(half[1]) << 32;
  }

 private:
  __m256i below_[2], over_[2];
};

}  // namespace

void draw_avx2(const TileTriangle<int32_t>& triangle, TileBricks& tile) {
  draw_by_columns<Spread>(triangle, tile);
}

void draw_thin_avx2(const ThinTriangle<int32_t>& triangle, TileBricks& tile) {
  draw_thin_by_columns<Spread>(triangle, tile);
}

}  // namespace voxdag::cpu
