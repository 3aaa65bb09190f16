// The rasteriser for AVX-512: as draw_avx2.cc, but the edges that cross a column of bricks are not
// sorted out. All are tested, which in vectors of this length costs less than the branches.
#include "core/backend/cpu/draw_avx512.h"

#if defined(__AVX512F__) && defined(__AVX512BW__) && defined(__AVX512DQ__) && \
    defined(__AVX512VL__) && defined(__AVX512VBMI__) && defined(__BMI2__)

#include "core/backend/cpu/columns_avx512.h"
#include "core/backend/cpu/draw_portable.h"
#include "core/backend/cpu/heights_avx2.h"

namespace voxdag::cpu {
namespace {

template <int D>
struct EdgeColumns : Columns<D, EdgeSet512> {
  using Columns<D, EdgeSet512>::Columns;

  // The voxel columns of column `number` that are outside an edge or the triangle's box.
  VOXDAG_INLINE uint32_t outer(int number) const {
    const int p = number & 15, q = number >> 4;
    return this->over.outer(p, q) | outside<kP<D>>(p) | outside<kQ<D>>(q);
  }

 private:
  template <int Axis>
  VOXDAG_INLINE uint32_t outside(int brick) const {
    int low, high;
    this->template within_box<Axis>(brick, low, high);
    return kOutsideBits.bits[Axis == kQ<D>][low][high];
  }
};

// A triangle across D, in one layer of voxels: their columns are all that matters.
template <int D>
VOXDAG_INLINE void draw_flat(const TileTriangle<int32_t>& t, TileBricks& tile) {
  const EdgeColumns<D> columns(t);
  const int z = t.first_voxel[D];
  const uint32_t at_height = kBrickIndex<D>.of_height[z / 4];
  const uint64_t layer = kLayers.voxels[D][z % 4];
  columns.edge.for_each([&](int number) __attribute__((always_inline)) {
    uint32_t inner = columns.outer(number) ^ 0xffff;
    if constexpr (kP < D >> kQ<D>) inner = transposed(inner);
    tile.add(kBrickIndex<D>.of_column[number] | at_height, _pdep_u64(inner, layer));
  });
  columns.plain.for_each([&](int number) __attribute__((always_inline)) {
    tile.add(kBrickIndex<D>.of_column[number] | at_height, layer);
  });
}

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
    const int p = number & 15, q = number >> 4;
    const int64_t height = heights.origin + heights.step_p * p + heights.step_q * q;
    int64_t from = (height + (int64_t{1} << kColumnBits)) >> (kColumnBits + 2);
    int64_t to = (height + heights.reach) >> (kColumnBits + 2);
    from = from > columns.first[D] ? from : columns.first[D];
    to = to < columns.last[D] ? to : columns.last[D];
    if (from > to) return;
    const int brick = static_cast<int>(height >> (kColumnBits + 2));
    const int within =
        static_cast<int>(height >> (kColumnBits - kHeightBits)) & ((4 << kHeightBits) - 1);
    __m256i outer = _mm256_setzero_si256();
    if constexpr (Edges) outer = _mm256_movm_epi16(static_cast<__mmask16>(columns.outer(number)));
    HeightBounds bounds = heights.bounds(p, q, brick, within, outer);
    if constexpr (Edges) bounds = _mm256_max_epu8(bounds, sides.bounds(p, q, brick));
    const Spread512<D> spread(bounds);
    const uint32_t index = kBrickIndex<D>.of_column[number];
    for (int64_t z = from; z <= to; ++z)
      tile.add(index | kBrickIndex<D>.of_height[z], spread.mask(z - brick));
  }

  TileBricks& tile;
  const EdgeColumns<D> columns;
  const Heights<D> heights;
  Sides512 sides;
};

template <int D>
VOXDAG_INLINE void draw_along(const TileTriangle<int32_t>& t, TileBricks& tile) {
  if ((t.normal[kP<D>] | t.normal[kQ<D>]) == 0)
    draw_flat<D>(t, tile);
  else
    ColumnWalk<D>(t, tile).run();
}

}  // namespace

void draw_avx512(const TileTriangle<int32_t>& triangle, TileBricks& tile) {
  if (triangle.normal[triangle.dominant] == 0) return draw_exactly(triangle, tile);
  if (triangle.dominant == 0)
    draw_along<0>(triangle, tile);
  else if (triangle.dominant == 1)
    draw_along<1>(triangle, tile);
  else
    draw_along<2>(triangle, tile);
}

}  // namespace voxdag::cpu

#endif
