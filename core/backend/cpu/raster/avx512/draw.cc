// The rasterizer for AVX-512: like avx2/draw.cc, but in every column of bricks all three edges are
// tested, whether they cross it or not, which in vectors of this length costs less than branching.
#include "core/backend/cpu/raster/avx2/draw_by_columns.h"
#include "core/backend/cpu/raster/avx2/heights.h"
#include "core/backend/cpu/raster/avx512/height_bounds.h"
#include "core/backend/cpu/raster/kernels.h"

namespace voxdag::cpu {
namespace {

template <int D>
struct EdgeColumns : Columns<D, EdgeSet512> {
  VOXDAG_INLINE explicit EdgeColumns(const TileTriangle<int32_t>& triangle)
      : Columns<D, EdgeSet512>(triangle) {
    if (triangle.inside) return;
    exclude_beyond_box<kP<D>>(outside_p_, kLowP);
    exclude_beyond_box<kQ<D>>(outside_q_, kLowQ);
  }

  template <class Visit>
  VOXDAG_INLINE void for_each_inner(Visit visit) const {
    this->edge.for_each([&](int number) __attribute__((always_inline)) {
      visit(number, outer(number) ^ 0xffff);
    });
  }

  // The voxel columns of column `number` that are outside an edge or the triangle's box.
  VOXDAG_INLINE uint32_t outer(int number) const {
    const int p = number & 15, q = number >> 4;
    return this->over.outer(p, q) | outside_p_[p] | outside_q_[q];
  }

 private:
  // Voxel columns (numbered p + 2 q + 4 p + 8 q by bits) of p = 0 .. 3, and of q.
  static constexpr uint16_t kLowP[4] = {0x0505, 0x0a0a, 0x5050, 0xa0a0};
  static constexpr uint16_t kLowQ[4] = {0x0033, 0x00cc, 0x3300, 0xcc00};

  // In the first and the last brick along an axis, the voxel columns beyond the triangle's box.
  template <int Axis>
  VOXDAG_INLINE void exclude_beyond_box(uint16_t (&bits)[16], const uint16_t (&columns)[4]) {
    const int low = this->t.first_voxel[Axis], high = this->t.last_voxel[Axis];
    for (int k = 0; k < 3; ++k) {
      bits[low / 4] |= k < low % 4 ? columns[k] : 0;
      bits[high / 4] |= 3 - k > high % 4 ? columns[3 - k] : 0;
    }
  }

  uint16_t outside_p_[16] = {}, outside_q_[16] = {};  // by brick
};

template <int D>
class ColumnWalk {
 public:
  VOXDAG_INLINE ColumnWalk(const TileTriangle<int32_t>& triangle, TileBricks& bricks)
      : tile(bricks), columns(triangle), heights(triangle) {
    if (!triangle.inside) sides.template set<D>(triangle);
  }

  VOXDAG_INLINE void run() {
    columns.edge.for_each([this](int number)
                              __attribute__((always_inline)) { column<true>(number); });
    columns.plain.for_each([this](int number)
                               __attribute__((always_inline)) { column<false>(number); });
  }

 private:
  template <bool Edges>
  VOXDAG_INLINE void column(int number) {
    const auto at = heights.column(number & 15, number >> 4, columns.first[D], columns.last[D]);
    if (at.from > at.to) return;
    __m256i outer = _mm256_setzero_si256();
    if constexpr (Edges) outer = _mm256_movm_epi16(static_cast<__mmask16>(columns.outer(number)));
    HeightBounds bounds = heights.bounds(at, outer);
    if constexpr (Edges) bounds = _mm256_max_epu8(bounds, sides.bounds(at.p, at.q, at.brick));
    const Spread512<D> spread(bounds);
    const uint32_t index = kBrickIndex<D>.of_column[number];
    for (int64_t z = at.from; z <= at.to; ++z)
      tile.add(index | kBrickIndex<D>.of_height[z], spread.mask(z - at.brick));
  }

  TileBricks& tile;
  const EdgeColumns<D> columns;
  const Heights<D> heights;
  Sides512 sides;
};

}  // namespace

void draw_avx512(const TileTriangle<int32_t>& triangle, TileBricks& tile) {
  draw_by_columns<EdgeColumns, ColumnWalk>(triangle, tile);
}

}  // namespace voxdag::cpu
