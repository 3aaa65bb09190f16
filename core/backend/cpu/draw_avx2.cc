// The rasteriser for AVX2 and BMI2. Bricks are visited in columns along the axis of the normal's
// largest component ("height"), where the plane passes a voxel column within a few voxels.
//
//   1. Edges bound the columns of bricks in each row. In a column that no edge crosses only the
//      plane matters; where one edge crosses, on the plane the other two hold throughout, so that
//      one is tested; where more do, all are, and the triangle's box.
//   2. All 16 voxel columns of a column of bricks at once: the heights between which the plane
//      passes them (heights_avx2.h), then one bit per voxel of each brick.
//   3. Edges in the other two projections, 16 columns at once (edges_avx2.h).
#include "core/backend/cpu/draw_avx2.h"

#if defined(__AVX2__) && defined(__BMI2__)

#include <immintrin.h>

#include "core/backend/cpu/draw_portable.h"
#include "core/backend/cpu/edges_avx2.h"
#include "core/backend/cpu/heights_avx2.h"

namespace voxdag::cpu {
namespace {

// Bits of voxel columns (in the order of kP, kQ) to bits of the brick's voxels.
template <int Axis>
VOXDAG_INLINE uint64_t widen(uint32_t columns) {
  // Columns are in Morton order of the two other axes, the lower one first.
  if constexpr (Axis == 2) {
    const uint64_t m = _pdep_u64(columns, 0x0f0f0f0f) * 0x11;
    return m | m << 32;
  } else if constexpr (Axis == 1) {
    uint64_t m = _pdep_u64(columns, 0x0000333300003333);
    m |= m << 2;
    return m | m << 16;
  } else {
    uint64_t m = _pdep_u64(columns, 0x0055005500550055);
    m |= m << 1;
    return m | m << 8;
  }
}

// [axis][first][last]: the voxels of a brick between two coordinates.
struct RangeMasks {
  uint64_t masks[3][4][4] = {};
  constexpr RangeMasks() {
    for (int voxel = 0; voxel < 64; ++voxel)
      for (int axis = 0; axis < 3; ++axis) {
        const int k = (voxel >> axis & 1) | (voxel >> (axis + 3) & 1) << 1;
        for (int first = 0; first <= k; ++first)
          for (int last = k; last < 4; ++last) masks[axis][first][last] |= uint64_t{1} << voxel;
      }
  }
};
constexpr RangeMasks kRanges;

// Columns of bricks: bit p of row q, visited as number p + 16 q. Visited from one loop, whose
// length the processor need not guess row by row.
struct ColumnSet {
  alignas(8) uint16_t rows[16] = {};

  template <class Visit>
  VOXDAG_INLINE void for_each(Visit visit) const {
    for (int part = 0; part < 4; ++part) {
      uint64_t bits;
      __builtin_memcpy(&bits, rows + 4 * part, 8);
      for (; bits != 0; bits &= bits - 1) {
        const int number = 64 * part + __builtin_ctzll(bits);
        visit(number);
      }
    }
  }
};

// Parts of a brick's Morton index in the tile: its column's, by number, and its height's.
template <int D>
struct BrickIndex {
  uint16_t of_column[256] = {};
  uint16_t of_height[16] = {};
  constexpr BrickIndex() {
    for (int i = 0; i < 256; ++i)
      of_column[i] = static_cast<uint16_t>(kSpread[i % 16] << kP<D> | kSpread[i / 16] << kQ<D>);
    for (int z = 0; z < 16; ++z) of_height[z] = static_cast<uint16_t>(kSpread[z] << D);
  }
};
template <int D>
inline constexpr BrickIndex<D> kBrickIndex;

template <int D>
class ColumnWalk {
 public:
  VOXDAG_INLINE ColumnWalk(const TileTriangle<int32_t>& triangle, TileBricks& bricks)
      : t(triangle), tile(bricks), heights(triangle) {
    for (int a = 0; a < 3; ++a) {
      first[a] = t.first_voxel[a] / 4;
      last[a] = t.last_voxel[a] / 4;
    }
  }

  VOXDAG_INLINE void run() {
    ColumnSet plain, edge;
    if (t.inside) {
      for (int q = first[Q]; q <= last[Q]; ++q) plain.rows[q] = columns(first[P], last[P]);
    } else {
      over.set(t.edges[D], D != 2);
      side_p.set(t.edges[P], P == 1);
      side_q.set(t.edges[Q], Q == 1);
      const RowBounds bounds(over, first[P], last[P]);
      for (int q = first[Q]; q <= last[Q]; ++q) {
        const Row row = bounds.row(q);
        const uint16_t all = columns(row.from, row.to);
        plain.rows[q] = all & columns(row.inner_from, row.inner_to);
        edge.rows[q] = all & ~plain.rows[q];
      }
      edge.for_each([this](int number) __attribute__((always_inline)) { edge_column(number); });
    }
    plain.for_each([this](int number) __attribute__((always_inline)) {
      column<0>(number, 0, {0, 0, 0});
    });
  }

 private:
  static constexpr int P = kP<D>, Q = kQ<D>;

  // Bits from..to, none if from > to; -16 <= to, from <= 16.
  static VOXDAG_INLINE uint16_t columns(int from, int to) {
    return static_cast<uint16_t>(0xffffu >> (15 - to) & 0xffffu << from);
  }

  VOXDAG_INLINE void edge_column(int number) {
    const int p = number & 15, q = number >> 4;
    const int64_t most[3] = {over.most(0, p, q), over.most(1, p, q), over.most(2, p, q)};
    if ((most[0] | most[1] | most[2]) < 0) return;
    const uint32_t c0 = static_cast<uint64_t>(most[0] - over.drop[0]) >> 63;
    const uint32_t c1 = static_cast<uint64_t>(most[1] - over.drop[1]) >> 63;
    const uint32_t c2 = static_cast<uint64_t>(most[2] - over.drop[2]) >> 63;
    if (c0 + c1 + c2 == 1)
      column<1>(number, static_cast<int>(c1 + 2 * c2), most);
    else
      column<3>(number, 0, most);
  }

  // Edges: how many of the edges are tested, none, `edge` or all.
  template <int Edges>
  VOXDAG_INLINE void column(int number, int edge, const int64_t (&most)[3]) {
    const int p = number & 15, q = number >> 4;
    const int64_t height = heights.origin + heights.step_p * p + heights.step_q * q;
    int64_t from = (height + (int64_t{1} << kColumnBits)) >> (kColumnBits + 2);
    int64_t to = (height + heights.reach) >> (kColumnBits + 2);
    from = from > first[D] ? from : first[D];
    to = to < last[D] ? to : last[D];
    if (from > to) return;
    const int64_t brick = height >> (kColumnBits + 2);
    const int within =
        static_cast<int>(height >> (kColumnBits - kHeightBits)) & ((4 << kHeightBits) - 1);
    __m256i outer = _mm256_setzero_si256();
    if constexpr (Edges > 0) {
      __m256i low, high;
      over.outer(most, Edges == 1 ? edge : 0, Edges == 1 ? edge : 2, low, high);
      outer = _mm256_srai_epi16(_mm256_packs_epi32(low, high), 15);
      if (Edges == 3 && _mm256_movemask_epi8(outer) == -1) return;
    }
    const auto bounds = heights.bounds(p, q, static_cast<int>(brick), within, outer);
    const uint32_t index = kBrickIndex<D>.of_column[number];
    for (int64_t z = from; z <= to; ++z) {
      uint64_t mask = bounds.mask(static_cast<int>(z - brick));
      if constexpr (Edges > 0) mask &= side_mask<Edges>(edge, p, q, static_cast<int>(z));
      if constexpr (Edges == 3)
        mask &= range_mask<P>(p) & range_mask<Q>(q) & range_mask<D>(static_cast<int>(z));
      tile.add(index | kBrickIndex<D>.of_height[z], mask);
    }
  }

  // The voxels of a brick that the edges leave in the projections along P and along Q.
  template <int Edges>
  VOXDAG_INLINE uint64_t side_mask(int edge, int p, int q, int z) const {
    int64_t along_p[3], along_q[3];
    const int from = Edges == 1 ? edge : 0, to = Edges == 1 ? edge : 2;
    int64_t signs = 0;
    for (int i = from; i <= to; ++i) {
      // Projections list the lower axis first.
      along_p[i] = side_p.most(i, Q < D ? q : z, Q < D ? z : q);
      along_q[i] = side_q.most(i, P < D ? p : z, P < D ? z : p);
      signs |= along_p[i] | along_q[i];
    }
    if (signs < 0) return 0;
    return widen<P>(side_p.inner_columns(along_p, from, to)) &
           widen<Q>(side_q.inner_columns(along_q, from, to));
  }

  // The voxels of a brick within the triangle's box along one axis.
  template <int Axis>
  VOXDAG_INLINE uint64_t range_mask(int brick) const {
    const int low = t.first_voxel[Axis] - 4 * brick, high = t.last_voxel[Axis] - 4 * brick;
    return kRanges.masks[Axis][low > 0 ? low : 0][high < 3 ? high : 3];
  }

  const TileTriangle<int32_t>& t;
  TileBricks& tile;
  int first[3], last[3];  // bricks of the triangle's box
  const Heights<D> heights;
  EdgeSet<true> over;             // edges seen along D
  EdgeSet<false> side_p, side_q;  // and along the other axes
};

}  // namespace

void draw_avx2(const TileTriangle<int32_t>& triangle, TileBricks& tile) {
  if (triangle.normal[triangle.dominant] == 0) return draw_exactly(triangle, tile);
  if (triangle.dominant == 0)
    ColumnWalk<0>(triangle, tile).run();
  else if (triangle.dominant == 1)
    ColumnWalk<1>(triangle, tile).run();
  else
    ColumnWalk<2>(triangle, tile).run();
}

}  // namespace voxdag::cpu

#endif
