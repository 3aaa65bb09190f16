// The rasteriser for AVX2 and BMI2. Bricks are visited in columns along the axis of the normal's
// largest component ("height"), where the plane passes a voxel column within a few voxels.
//
//   1. Edges cull whole columns of bricks. In a column that no edge crosses only the plane matters;
//      where one edge crosses, on the plane the other two hold throughout, so that one is tested.
//   2. All 16 voxel columns at once: the heights between which the plane passes each of them, in
//      fixed point of 12 bits below the voxel, widened by more than their error. A height that is
//      then too near to a voxel boundary (3 columns of bricks in 100) is made exactly.
//   3. Each brick of the column: one bit per voxel by comparing its height with the two bounds.
//   4. Edges in the other two projections, 16 columns at once in 32 bits.
//
// 32 bits suffice for edges: |a|, |b| <= 2^27, so over a brick the value differs by at most
// 3 (|a| + |b|) < 2^30 from its largest, which is computed in 64 bits and clamped to 2^30.
#include "core/backend/cpu/draw_avx2.h"

#if defined(__AVX2__) && defined(__BMI2__)

#include <immintrin.h>

#include "core/backend/cpu/draw_portable.h"

#define VOXDAG_INLINE __attribute__((always_inline)) inline

namespace voxdag::cpu {
namespace {

using Edge = TileTriangle<int32_t>::Edge;

constexpr int kHeightBits = 12;  // below the voxel, in 16-bit lanes
constexpr int kColumnBits = 40;  // below the voxel, per column of bricks in 64 bits
constexpr int64_t kEdgeClamp = int64_t{1} << 30;

// The axes of a column's footprint for columns along D, chosen so that the 16 voxel columns
// p + 2 q (low bits) + 4 p + 8 q (high bits) fall into bytes as brick_bits() needs them.
template <int D>
constexpr int kP = D == 0 ? 2 : 0;
template <int D>
constexpr int kQ = D == 2   ? 1
                   : D == 1 ? 2
                            : 1;

constexpr int column_p(int column) { return (column & 1) | (column >> 1 & 2); }
constexpr int column_q(int column) { return (column >> 1 & 1) | (column >> 2 & 2); }

VOXDAG_INLINE int64_t least(int64_t a, int64_t b) { return a < b ? a : b; }
VOXDAG_INLINE int64_t above_zero(int64_t a) { return a > 0 ? a : 0; }
VOXDAG_INLINE int64_t magnitude(int64_t a) { return a < 0 ? -a : a; }

// For each voxel column, in two vectors of eight, what a and b add to an edge's value, less what
// they add at most.
struct EdgeLanes {
  __m256i low, high;

  template <bool Packed>
  VOXDAG_INLINE void set(int64_t a, int64_t b) {
    // Packed: columns 0-3, 8-11 and 4-7, 12-15, so that packing two vectors restores the order.
    const __m256i one_p = _mm256_setr_epi32(0, -1, 0, -1, 0, -1, 0, -1);
    const __m256i one_q = _mm256_setr_epi32(0, 0, -1, -1, 0, 0, -1, -1);
    const __m256i upper = _mm256_setr_epi32(0, 0, 0, 0, -1, -1, -1, -1);
    const __m256i va = _mm256_set1_epi32(static_cast<int32_t>(a));
    const __m256i vb = _mm256_set1_epi32(static_cast<int32_t>(b));
    const __m256i va2 = _mm256_add_epi32(va, va), vb2 = _mm256_add_epi32(vb, vb);
    const __m256i most =
        _mm256_set1_epi32(static_cast<int32_t>(3 * (above_zero(a) + above_zero(b))));
    __m256i base = _mm256_add_epi32(_mm256_and_si256(va, one_p), _mm256_and_si256(vb, one_q));
    base = _mm256_sub_epi32(base, most);
    low = _mm256_add_epi32(base, _mm256_and_si256(Packed ? vb2 : va2, upper));
    high = _mm256_add_epi32(low, Packed ? va2 : vb2);
  }
};

// The edges in one projection, along axis d.
template <bool Packed>
struct EdgeSet {
  int64_t p4[3], q4[3], c[3];  // largest value over a brick: p4 brick_p + q4 brick_q + c
  int64_t drop[3];             // from there to the value at the far corner of the brick's footprint
  EdgeLanes lanes[3];

  // `swap`: an edge's a belongs to axis q and b to p.
  VOXDAG_INLINE void set(const Edge (&edges)[3], bool swap) {
    for (int i = 0; i < 3; ++i) {
      const int64_t a = swap ? edges[i].b : edges[i].a, b = swap ? edges[i].a : edges[i].b;
      p4[i] = 4 * a;
      q4[i] = 4 * b;
      c[i] = edges[i].c + 3 * (above_zero(a) + above_zero(b));
      drop[i] = 4 * (magnitude(a) + magnitude(b));
      lanes[i].template set<Packed>(a, b);
    }
  }
  VOXDAG_INLINE int64_t most(int i, int p, int q) const { return c[i] + p4[i] * p + q4[i] * q; }
};

VOXDAG_INLINE __m256i clamped(int64_t most) {
  return _mm256_set1_epi32(static_cast<int32_t>(least(most, kEdgeClamp)));
}

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

// Columns, in Morton order, on the inner side of edges [first, last] of a projection at a brick;
// `most` are their largest values there, not negative.
VOXDAG_INLINE uint32_t inner_columns(const EdgeSet<false>& set, const int64_t (&most)[3], int first,
                                     int last) {
  __m256i low = _mm256_setzero_si256(), high = low;
  for (int i = first; i <= last; ++i) {
    const __m256i base = clamped(most[i]);
    low = _mm256_or_si256(low, _mm256_add_epi32(base, set.lanes[i].low));
    high = _mm256_or_si256(high, _mm256_add_epi32(base, set.lanes[i].high));
  }
  const uint32_t outer = static_cast<uint32_t>(_mm256_movemask_ps(_mm256_castsi256_ps(low))) |
                         static_cast<uint32_t>(_mm256_movemask_ps(_mm256_castsi256_ps(high))) << 8;
  return ~outer & 0xffff;
}

// Where, in the two vectors of a brick's 64 voxels as bytes, the bytes of a column stand, and the
// height of each voxel within the brick. In Morton order axis x owns bits x and x + 3 of a voxel's
// number; bit 5 chooses the vector, bit 4 its half, the others the byte.
template <int D>
struct ByteOrder {
  alignas(32) int8_t column[2][32] = {};
  alignas(32) int8_t height[2][32] = {};
  constexpr ByteOrder() {
    for (int voxel = 0; voxel < 64; ++voxel) {
      const auto coordinate = [voxel](int axis) {
        return (voxel >> axis & 1) | (voxel >> (axis + 3) & 1) << 1;
      };
      const int p = coordinate(kP<D>), q = coordinate(kQ<D>);
      const int number = (p & 1) | (q & 1) << 1 | (p & 2) << 1 | (q & 2) << 2;
      // A half holds eight columns; which half stands where is arranged by column_halves().
      column[voxel / 32][voxel % 32] = static_cast<int8_t>(number & 7);
      height[voxel / 32][voxel % 32] = static_cast<int8_t>(coordinate(D));
    }
  }
};
template <int D>
inline constexpr ByteOrder<D> kByteOrder;

VOXDAG_INLINE __m256i load(const void* at) {
  return _mm256_load_si256(static_cast<const __m256i*>(at));
}

// The heights between which the plane passes the 16 voxel columns of a column of bricks, relative
// to a brick's first voxel: voxels with below < height <= top are touched.
struct Heights {
  __m256i below[2], top[2];  // as bytes, one per voxel of the brick, in kByteOrder
};

template <int D>
class ColumnWalk {
 public:
  VOXDAG_INLINE ColumnWalk(const TileTriangle<int32_t>& triangle, TileBricks& bricks)
      : t(triangle), tile(bricks) {
    for (int a = 0; a < 3; ++a) {
      first[a] = t.first_voxel[a] / 4;
      last[a] = t.last_voxel[a] / 4;
    }
    set_plane();
  }

  VOXDAG_INLINE void run() {
    if (t.inside) {
      for (int q = first[Q]; q <= last[Q]; ++q)
        for (int p = first[P]; p <= last[P]; ++p) column<0>(p, q, 0, {});
      return;
    }
    over.set(t.edges[D], D != 2);
    side_p.set(t.edges[P], P == 1);
    side_q.set(t.edges[Q], Q == 1);
    for (int q = first[Q]; q <= last[Q]; ++q) {
      int64_t most[3];
      for (int i = 0; i < 3; ++i) most[i] = over.most(i, first[P], q);
      for (int p = first[P]; p <= last[P]; ++p) {
        if ((most[0] | most[1] | most[2]) >= 0) edge_column(p, q, most);
        for (int i = 0; i < 3; ++i) most[i] += over.p4[i];
      }
    }
  }

 private:
  static constexpr int P = kP<D>, Q = kQ<D>;

  VOXDAG_INLINE void set_plane() {
    const int64_t np = t.normal[P], nq = t.normal[Q];
    const double inverse = 1.0 / static_cast<double>(t.normal[D]);
    const double column_unit = inverse * static_cast<double>(int64_t{1} << kColumnBits);
    step_p = static_cast<int64_t>(-4.0 * static_cast<double>(np) * column_unit);
    step_q = static_cast<int64_t>(-4.0 * static_cast<double>(nq) * column_unit);
    // The lowest of the 16, one unit of 16-bit lanes lower.
    const int64_t lowest = t.lowest + 3 * (above_zero(np) + above_zero(nq));
    height0 = static_cast<int64_t>(-static_cast<double>(lowest) * column_unit) -
              (int64_t{1} << (kColumnBits - kHeightBits));
    const double unit = inverse * (1 << kHeightBits);
    const float sp = static_cast<float>(static_cast<double>(magnitude(np)) * unit);
    const float sq = static_cast<float>(static_cast<double>(magnitude(nq)) * unit);
    const int width = static_cast<int>(static_cast<double>(t.width) * unit) + 5;
    reach = static_cast<int>(3.0f * (sp + sq)) + 2 + width;
    width16 = _mm256_set1_epi16(static_cast<int16_t>(width));
    const __m256 p_low =
        np > 0 ? _mm256_setr_ps(3, 2, 3, 2, 3, 2, 3, 2) : _mm256_setr_ps(0, 1, 0, 1, 0, 1, 0, 1);
    const __m256 p_high =
        np > 0 ? _mm256_sub_ps(p_low, _mm256_set1_ps(2)) : _mm256_add_ps(p_low, _mm256_set1_ps(2));
    const __m256 q_both =
        nq > 0 ? _mm256_setr_ps(3, 3, 2, 2, 1, 1, 0, 0) : _mm256_setr_ps(0, 0, 1, 1, 2, 2, 3, 3);
    const __m256 from_q = _mm256_mul_ps(q_both, _mm256_set1_ps(sq));
    const __m256 vsp = _mm256_set1_ps(sp);
    lane_heights =
        _mm256_packs_epi32(_mm256_cvttps_epi32(_mm256_add_ps(_mm256_mul_ps(p_low, vsp), from_q)),
                           _mm256_cvttps_epi32(_mm256_add_ps(_mm256_mul_ps(p_high, vsp), from_q)));
  }

  VOXDAG_INLINE void edge_column(int p, int q, const int64_t (&most)[3]) {
    const uint32_t c0 = static_cast<uint64_t>(most[0] - over.drop[0]) >> 63;
    const uint32_t c1 = static_cast<uint64_t>(most[1] - over.drop[1]) >> 63;
    const uint32_t c2 = static_cast<uint64_t>(most[2] - over.drop[2]) >> 63;
    const uint32_t crossing = c0 + c1 + c2;
    if (crossing == 0)
      column<0>(p, q, 0, most);
    else if (crossing == 1)
      column<1>(p, q, static_cast<int>(c1 + 2 * c2), most);
    else
      column<3>(p, q, 0, most);
  }

  // Edges: how many of the edges are tested, all or only `edge`.
  template <int Edges>
  VOXDAG_INLINE void column(int p, int q, int edge, const int64_t (&most)[3]) {
    const int64_t height = height0 + step_p * p + step_q * q;
    const int brick = static_cast<int>(height >> (kColumnBits + 2));
    const int within =
        static_cast<int>(height >> (kColumnBits - kHeightBits)) & ((4 << kHeightBits) - 1);
    int from = brick + (((within >> kHeightBits) + 1) >> 2);
    int to = brick + ((within + reach) >> (kHeightBits + 2));
    from = from > first[D] ? from : first[D];
    to = to < last[D] ? to : last[D];
    if (from > to) return;
    __m256i outer = _mm256_setzero_si256();
    if constexpr (Edges > 0) {
      outer = outer_columns<Edges>(edge, most);
      if (Edges == 3 && _mm256_movemask_epi8(outer) == -1) return;
    }
    Heights heights = column_heights(p, q, brick, within, outer);
    const uint32_t index = kSpread[p] << P | kSpread[q] << Q;
    for (int z = from; z <= to; ++z) {
      uint64_t mask = height_mask(heights, z - brick);
      if constexpr (Edges > 0) mask &= side_mask<Edges>(edge, p, q, z);
      if constexpr (Edges == 3) mask &= box_mask(p, q, z);
      if (mask != 0) tile.add(index | kSpread[z] << D, mask);
    }
  }

  // All ones in the lanes of columns on the outer side of an edge.
  template <int Edges>
  VOXDAG_INLINE __m256i outer_columns(int edge, const int64_t (&most)[3]) const {
    __m256i low = _mm256_setzero_si256(), high = low;
    for (int i = Edges == 1 ? edge : 0; i < (Edges == 1 ? edge + 1 : 3); ++i) {
      const __m256i base = clamped(most[i]);
      low = _mm256_or_si256(low, _mm256_add_epi32(base, over.lanes[i].low));
      high = _mm256_or_si256(high, _mm256_add_epi32(base, over.lanes[i].high));
    }
    return _mm256_srai_epi16(_mm256_packs_epi32(low, high), 15);
  }

  VOXDAG_INLINE Heights column_heights(int p, int q, int brick, int within, __m256i outer) const {
    __m256i below = _mm256_add_epi16(_mm256_set1_epi16(static_cast<int16_t>(within)), lane_heights);
    __m256i top = _mm256_add_epi16(below, width16);
    // True heights are up to 3 units above `below` and up to 4 below `top`.
    const __m256i lowered = _mm256_sub_epi16(top, _mm256_set1_epi16(5));
    const __m256i raised = _mm256_add_epi16(below, _mm256_set1_epi16(3));
    const __m256i differ =
        _mm256_or_si256(_mm256_xor_si256(raised, below), _mm256_xor_si256(lowered, top));
    const __m256i whole = _mm256_set1_epi16(static_cast<int16_t>(0xffff << kHeightBits));
    if (!_mm256_testz_si256(differ, whole)) [[unlikely]]
      make_exact(p, q, brick, _mm256_and_si256(differ, whole), below, top);
    below = _mm256_or_si256(below, outer);
    const __m256i bytes = _mm256_packus_epi16(_mm256_srli_epi16(below, kHeightBits),
                                              _mm256_srli_epi16(top, kHeightBits));
    return spread(bytes);
  }

  // Settles the columns whose bits in `doubtful` are not 0 by division.
  [[gnu::noinline]] void make_exact(int p, int q, int brick, __m256i doubtful, __m256i& below,
                                    __m256i& top) const {
    alignas(32) uint16_t doubt[16], low[16], high[16];
    _mm256_store_si256(reinterpret_cast<__m256i*>(doubt), doubtful);
    _mm256_store_si256(reinterpret_cast<__m256i*>(low), below);
    _mm256_store_si256(reinterpret_cast<__m256i*>(high), top);
    const int64_t n = t.normal[D];
    for (int i = 0; i < 16; ++i) {
      if (doubt[i] == 0) continue;
      const int64_t at_zero =
          t.lowest + t.normal[P] * (4 * p + column_p(i)) + t.normal[Q] * (4 * q + column_q(i));
      // Voxels z with 0 <= at_zero + n z <= width.
      low[i] = static_cast<uint16_t>((floor_divide(-at_zero - 1, n) - 4 * brick) << kHeightBits);
      high[i] =
          static_cast<uint16_t>((floor_divide(t.width - at_zero, n) - 4 * brick) << kHeightBits);
    }
    below = load(low);
    top = load(high);
  }

  static int64_t floor_divide(int64_t a, int64_t b) {
    const int64_t quotient = a / b;
    return quotient - (quotient * b > a ? 1 : 0);
  }

  // From one byte per column (`below` of eight columns, then `top` of the same, in either half) to
  // one byte per voxel.
  static VOXDAG_INLINE Heights spread(__m256i bytes) {
    const __m256i order0 = load(kByteOrder<D>.column[0]), order1 = load(kByteOrder<D>.column[1]);
    const __m256i eight = _mm256_set1_epi8(8);
    // The half of a column is its high bit of q: for D = 1 that is the vector, otherwise the half.
    const __m256i half0 = D == 1 ? _mm256_permute4x64_epi64(bytes, 0x44) : bytes;
    const __m256i half1 = D == 1 ? _mm256_permute4x64_epi64(bytes, 0xee) : bytes;
    return {{_mm256_shuffle_epi8(half0, order0), _mm256_shuffle_epi8(half1, order1)},
            {_mm256_shuffle_epi8(half0, _mm256_add_epi8(order0, eight)),
             _mm256_shuffle_epi8(half1, _mm256_add_epi8(order1, eight))}};
  }

  static VOXDAG_INLINE uint64_t height_mask(const Heights& heights, int bricks_up) {
    const __m256i up = _mm256_set1_epi8(static_cast<int8_t>(4 * bricks_up));
    uint32_t half[2];
    for (int i = 0; i < 2; ++i) {
      const __m256i z = _mm256_add_epi8(load(kByteOrder<D>.height[i]), up);
      half[i] = static_cast<uint32_t>(_mm256_movemask_epi8(_mm256_andnot_si256(
          _mm256_cmpgt_epi8(z, heights.top[i]), _mm256_cmpgt_epi8(z, heights.below[i]))));
    }
    return half[0] | static_cast<uint64_t>(half[1]) << 32;
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
    return widen<P>(inner_columns(side_p, along_p, from, to)) &
           widen<Q>(inner_columns(side_q, along_q, from, to));
  }

  // The voxels of a brick within the triangle's box.
  VOXDAG_INLINE uint64_t box_mask(int p, int q, int z) const {
    return range_mask<P>(p) & range_mask<Q>(q) & range_mask<D>(z);
  }
  template <int Axis>
  VOXDAG_INLINE uint64_t range_mask(int brick) const {
    const int low = t.first_voxel[Axis] - 4 * brick, high = t.last_voxel[Axis] - 4 * brick;
    if (low <= 0 && high >= 3) return ~uint64_t{0};
    // The four layers of a brick across an axis are the columns widen() makes from 4 bits of one
    // axis: the same four columns for every value of the other.
    uint64_t mask = 0;
    for (int k = low > 0 ? low : 0; k <= (high < 3 ? high : 3); ++k)
      mask |= kLayer<Axis> << ((k & 1) << Axis | (k & 2) << (Axis + 2));
    return mask;
  }
  // The voxels whose coordinate along an axis is 0.
  template <int Axis>
  static constexpr uint64_t kLayer = Axis == 2   ? 0x000000000f0f0f0full
                                     : Axis == 1 ? 0x0000333300003333ull
                                                 : 0x0055005500550055ull;

  const TileTriangle<int32_t>& t;
  TileBricks& tile;
  int first[3], last[3];            // bricks of the triangle's box
  int64_t height0, step_p, step_q;  // the lowest `below` of a column of bricks
  int reach;                        // from there to the highest `top`, kHeightBits
  __m256i lane_heights, width16;
  EdgeSet<true> over;
  EdgeSet<false> side_p, side_q;
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
