// The rasterizer of avx2/draw_by_columns.h for AVX-512. The voxels of a brick are the bytes of one
// vector.
#include <immintrin.h>

#include "core/backend/cpu/raster/avx2/draw_by_columns.h"
#include "core/backend/cpu/raster/avx2/thin_by_columns.h"
#include "core/backend/cpu/raster/kernels.h"

namespace voxdag::cpu {
namespace {

// Tables indexed by the voxel of a brick.
template <int D>
struct VoxelBytes {
  // For each voxel of a brick: the byte indexes in HeightBounds (sides.h) of the lower bound
  // (`below`) and the upper bound (`over`) of its voxel column.
  alignas(64) uint8_t below[64] = {};
  alignas(64) uint8_t over[64] = {};
  alignas(64) uint8_t height[4][64] = {};  // height above the floor of the first of four bricks
  alignas(64) uint8_t depth[4][64] = {};   // distance below the highest voxel of the four bricks
  constexpr VoxelBytes() {
    for (int voxel = 0; voxel < 64; ++voxel) {
      const int p = brick_coordinate(voxel, kP<D>), q = brick_coordinate(voxel, kQ<D>);
      const int column = (p & 1) | (q & 1) << 1 | (p & 2) << 1 | (q & 2) << 2;
      below[voxel] = static_cast<uint8_t>(column / 8 * 16 + column % 8);
      over[voxel] = static_cast<uint8_t>(below[voxel] + 8);
      for (int brick = 0; brick < 4; ++brick) {
        const int z = 4 * brick + brick_coordinate(voxel, D);
        height[brick][voxel] = static_cast<uint8_t>(z);
        depth[brick][voxel] = static_cast<uint8_t>(kMaxHeight - z);
      }
    }
  }
};
template <int D>
inline constexpr VoxelBytes<D> kVoxelBytes;

VOXDAG_INLINE __m512i load512(const void* at) { return _mm512_load_si512(at); }

// Copies the HeightBounds (sides.h) of a column of bricks to the 64 voxels of a brick. For each
// voxel, a byte of below_ and a byte of over_ have the bounds of its voxel column.
template <int D>
class Spread512 {
 public:
  VOXDAG_INLINE explicit Spread512(HeightBounds bounds) {
    const __m512i bytes = _mm512_castsi256_si512(bounds);
    below_ = _mm512_permutexvar_epi8(load512(kVoxelBytes<D>.below), bytes);
    over_ = _mm512_permutexvar_epi8(load512(kVoxelBytes<D>.over), bytes);
  }
  VOXDAG_INLINE uint64_t mask(int64_t up) const {
    const __mmask64 above = _mm512_cmplt_epu8_mask(below_, load512(kVoxelBytes<D>.height[up]));
    return _cvtmask64_u64(
        _mm512_mask_cmple_epu8_mask(above, over_, load512(kVoxelBytes<D>.depth[up])));
  }

 private:
  __m512i below_, over_;
};

}  // namespace

void draw_avx512(const TileTriangle<int32_t>& triangle, TileBricks& tile) {
  draw_by_columns<Spread512>(triangle, tile);
}

void draw_thin_avx512(const ThinTriangle<int32_t>& triangle, TileBricks& tile) {
  draw_thin_by_columns<Spread512>(triangle, tile);
}

}  // namespace voxdag::cpu
