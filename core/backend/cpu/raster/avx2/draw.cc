// The rasterizer for AVX2 and BMI2. Bricks are visited in columns along the axis of the normal's
// largest component ("height"), where the plane passes a voxel column within a few voxels.
//
//   1. Edges bound the columns of bricks in each row. In a column that no edge crosses only the
//      plane matters. An edge that does not cross the column is satisfied everywhere in it, so only
//      those that do cross are tested; with two or three of them also the triangle's box, since a
//      corner may be near.
//   2. All 16 voxel columns of a column of bricks at once: the heights between which the plane
//      passes them (heights.h), and the bounds of heights by the edges in the projections along the
//      two other axes (sides.h).
//   3. These bounds become one bit per voxel of each brick.
//
// A triangle perpendicular to an axis is one layer of voxels: its columns are its voxels.
#include <immintrin.h>

#include <type_traits>

#include "core/backend/cpu/raster/avx2/draw_by_columns.h"
#include "core/backend/cpu/raster/avx2/heights.h"
#include "core/backend/cpu/raster/avx2/sides.h"
#include "core/backend/cpu/raster/kernels.h"

namespace voxdag::cpu {
namespace {

// [set of edges]: the numbers of the edges whose bits are set.
struct EdgeLists {
  uint8_t edges[8][3] = {};
  constexpr EdgeLists() {
    for (int set = 0; set < 8; ++set)
      for (int edge = 0, count = 0; edge < 3; ++edge)
        if (set >> edge & 1) edges[set][count++] = static_cast<uint8_t>(edge);
  }
};
constexpr EdgeLists kEdgeLists;

// [of q][first][last]: all ones in the 16-bit lanes of voxel columns whose p (or q) within the
// brick is not from first to last.
struct OutsideLanes {
  alignas(32) uint16_t lanes[2][4][4][16] = {};
  constexpr OutsideLanes() {
    for (int column = 0; column < 16; ++column)
      for (int first = 0; first < 4; ++first)
        for (int last = 0; last < 4; ++last) {
          const int p = column_p(column), q = column_q(column);
          lanes[0][first][last][column] = p < first || p > last ? 0xffff : 0;
          lanes[1][first][last][column] = q < first || q > last ? 0xffff : 0;
        }
  }
};
constexpr OutsideLanes kOutside;

// Columns, and the positions of the edges relative to one of them.
template <int D>
struct EdgeColumns : Columns<D, EdgeSet> {
  using Columns<D, EdgeSet>::Columns;
  using Columns<D, EdgeSet>::over;

  // For a column of `edge`, calls visit(count, crossing, highest): the number of edges that cross
  // it, as an integral_constant, their set, and the largest values of all edges over the column.
  // Does nothing if the column is outside.
  template <class Visit>
  VOXDAG_INLINE void with_edges(int number, Visit visit) const {
    const int p = number & 15, q = number >> 4;
    const int64_t highest[3] = {over.highest(0, p, q), over.highest(1, p, q),
                                over.highest(2, p, q)};
    if ((highest[0] | highest[1] | highest[2]) < 0) return;
    const uint64_t crossing = static_cast<uint64_t>(highest[0] - over.drop[0]) >> 63 |
                              static_cast<uint64_t>(highest[1] - over.drop[1]) >> 63 << 1 |
                              static_cast<uint64_t>(highest[2] - over.drop[2]) >> 63 << 2;
    if ((crossing & (crossing - 1)) == 0)
      visit(std::integral_constant<int, 1>(), crossing, highest);
    else if (crossing != 7)
      visit(std::integral_constant<int, 2>(), crossing, highest);
    else
      visit(std::integral_constant<int, 3>(), crossing, highest);
  }

  // All ones in the 16-bit lanes of voxel columns outside one of the `Count` edges of the set
  // `crossing`; with several edges also of those outside the triangle's box.
  template <int Count>
  VOXDAG_INLINE __m256i outer(int number, uint64_t crossing, const int64_t (&highest)[3]) const {
    const __m256i lanes = over.template outer<Count>(kEdgeLists.edges[crossing], highest);
    if (Count == 1) return lanes;
    return _mm256_or_si256(
        lanes, _mm256_or_si256(outside<kP<D>>(number & 15), outside<kQ<D>>(number >> 4)));
  }

  template <class Visit>
  VOXDAG_INLINE void for_each_inner(Visit visit) const {
    this->edge.for_each([&](int number) __attribute__((always_inline)) {
      with_edges(
          number, [&](auto count, uint64_t crossing,
                      const int64_t(&highest)[3]) __attribute__((always_inline)) {
            const __m256i outside_edges = outer<count()>(number, crossing, highest);
            // A byte per column, in the halves' lower eight.
            const uint32_t bytes = ~static_cast<uint32_t>(
                _mm256_movemask_epi8(_mm256_packs_epi16(outside_edges, _mm256_setzero_si256())));
            visit(number, (bytes & 0xff) | (bytes >> 8 & 0xff00));
          });
    });
  }

 private:
  template <int Axis>
  VOXDAG_INLINE __m256i outside(int brick) const {
    const int low = this->t.first_voxel[Axis] - 4 * brick;
    const int high = this->t.last_voxel[Axis] - 4 * brick;
    return load(kOutside.lanes[Axis == kQ<D>][low > 0 ? low : 0][high < 3 ? high : 3]);
  }
};

template <int D>
class ColumnWalk {
 public:
  VOXDAG_INLINE ColumnWalk(const TileTriangle<int32_t>& triangle, TileBricks& bricks)
      : t(triangle), tile(bricks), columns(triangle), heights(triangle) {
    if (!t.inside) sides.set(t);
  }

  VOXDAG_INLINE void run() {
    columns.edge.for_each([this](int number) __attribute__((always_inline)) {
      columns.with_edges(
          number, [&](auto count, uint64_t crossing, const int64_t(&highest)[3]) __attribute__((
                      always_inline)) { column<count()>(number, crossing, highest); });
    });
    columns.plain.for_each([this](int number) __attribute__((always_inline)) {
      column<0>(number, 0, {0, 0, 0});
    });
  }

 private:
  // `Edges`: the number of edges in the set `crossing`, which are tested.
  template <int Edges>
  VOXDAG_INLINE void column(int number, uint64_t crossing, const int64_t (&highest)[3]) {
    const auto at = heights.column(number & 15, number >> 4, columns.first[D], columns.last[D]);
    if (at.from > at.to) return;
    __m256i outer = _mm256_setzero_si256();
    if constexpr (Edges > 0) outer = columns.template outer<Edges>(number, crossing, highest);
    if (Edges > 1 && _mm256_movemask_epi8(outer) == -1) return;
    HeightBounds bounds = heights.bounds(at, outer);
    for (int k = 0; k < Edges; ++k)
      bounds = _mm256_max_epu8(bounds,
                               sides.bounds(kEdgeLists.edges[crossing][k], at.p, at.q, at.brick));
    if constexpr (Edges > 1) bounds = _mm256_max_epu8(bounds, box_bounds(at.brick));
    const auto spread = heights.spread(bounds);
    const uint32_t index = kBrickIndex<D>.of_column[number];
    for (int64_t z = at.from; z <= at.to; ++z)
      tile.add(index | kBrickIndex<D>.of_height[z], spread.mask(static_cast<int>(z - at.brick)));
  }

  // The triangle's box as bounds of the heights.
  VOXDAG_INLINE HeightBounds box_bounds(int brick) const {
    const int below = t.first_voxel[D] - 1 - 4 * brick;
    const int above = kMaxHeight - t.last_voxel[D] + 4 * brick;
    return _mm256_unpacklo_epi64(_mm256_set1_epi8(static_cast<int8_t>(below > 0 ? below : 0)),
                                 _mm256_set1_epi8(static_cast<int8_t>(above > 0 ? above : 0)));
  }

  const TileTriangle<int32_t>& t;
  TileBricks& tile;
  const EdgeColumns<D> columns;
  const Heights<D> heights;
  Sides<D> sides;  // edges seen along the axes other than D
};

}  // namespace

void draw_avx2(const TileTriangle<int32_t>& triangle, TileBricks& tile) {
  draw_by_columns<EdgeColumns, ColumnWalk>(triangle, tile);
}

}  // namespace voxdag::cpu
