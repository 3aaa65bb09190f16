// The plane test: the range of heights at which the plane touches each of the 16 voxel columns of a
// column of bricks.
//
// Let D be the axis of the normal n's largest component. The plane touches voxel column (p, q) at
// the heights z with
//     0 <= n_D z + n.(p, q) + lowest <= width       (tile_triangle.h), that is
//     y <= z <= y + width / n_D                     with y = -(n.(p, q) + lowest) / n_D
// These are at most four voxels, since width <= 3 n_D.
//
// A column of bricks *begins* in the brick that contains the smallest of the 16 values y of its
// voxel columns. The voxel column with this value is the *lowest* voxel column.
//
// A vector has a 16-bit lane for the y of each voxel column. The unit of a lane is 2^-12 voxel, and
// y is relative to the floor of the brick in which the column of bricks begins. For the lowest
// voxel column, y is in 0..4 voxels. For the other voxel columns y is up to 6 voxels more. The
// upper bound y + width / n_D is up to 3 voxels above y. y is rounded down and the upper bound is
// rounded up, by little more than 2 units of a lane. If a lane is very close to a whole number of
// voxels, the exact value can be on the other side of this number. In this case the code computes
// the height exactly by division. About 2 in 100 columns of bricks have such a lane.
//
// Only included by sources compiled for AVX2 or AVX-512; everything has internal linkage.
#pragma once

#include <immintrin.h>

#include "core/backend/cpu/raster/avx2/sides.h"
#include "core/backend/cpu/raster/tile_triangle.h"

namespace voxdag::cpu {
namespace {

constexpr int kHeightBits = 12;  // bits for the fraction of a voxel, in 16-bit lanes
// Bits for the fraction of a voxel, in the 64-bit height of a column of bricks.
constexpr int kColumnBits = 40;

VOXDAG_INLINE __m256i load(const void* at) {
  return _mm256_load_si256(static_cast<const __m256i*>(at));
}

// only[i] has all ones in the 16-bit lane of voxel column i, and 0 in the other lanes.
struct SingleLanes {
  alignas(32) uint16_t only[16][16] = {};
  constexpr SingleLanes() {
    for (int i = 0; i < 16; ++i) only[i][i] = 0xffff;
  }
};
constexpr SingleLanes kLanes;

VOXDAG_INLINE int64_t clamp_to_zero(int64_t a) { return a > 0 ? a : 0; }
VOXDAG_INLINE int64_t magnitude(int64_t a) { return a < 0 ? -a : a; }

template <int D>
class Heights {
 public:
  // Prepares the test for the plane that touches the voxels k with 0 <= normal.k + lowest <= width.
  // `normal` must outlive this object.
  VOXDAG_INLINE Heights(const int64_t (&normal)[3], int64_t lowest, int64_t width)
      : normal_(normal), lowest_(lowest), width_(width) {
    const int64_t np = normal[P], nq = normal[Q];
    const double inverse = 1.0 / static_cast<double>(normal[D]);
    const double column_unit = inverse * static_cast<double>(int64_t{1} << kColumnBits);
    step_p_ = static_cast<int64_t>(-4.0 * static_cast<double>(np) * column_unit);
    step_q_ = static_cast<int64_t>(-4.0 * static_cast<double>(nq) * column_unit);
    const int64_t at_origin = lowest + 3 * (clamp_to_zero(np) + clamp_to_zero(nq));
    origin_ = static_cast<int64_t>(-static_cast<double>(at_origin) * column_unit -
                                   kLowered * (int64_t{1} << (kColumnBits - kHeightBits)));
    const double unit = inverse * (1 << kHeightBits);
    const float sp = static_cast<float>(static_cast<double>(magnitude(np)) * unit);
    const float sq = static_cast<float>(static_cast<double>(magnitude(nq)) * unit);
    const float width_units = static_cast<float>(static_cast<double>(width) * unit);
    reach_ = static_cast<int64_t>(3.0f * (sp + sq) + width_units + kTopRaised + 2.0f)
             << (kColumnBits - kHeightBits);
    set_lanes(np > 0, sp, nq > 0, sq, width_units);
  }

  // The place where the plane crosses the column of bricks (p, q).
  struct Column {
    int p, q;
    int64_t from, to;  // range of bricks that the plane can touch; empty if from > to
    int brick;         // brick in which this column of bricks begins (see above)
    int within;        // y of the lowest voxel column, above the floor of `brick`, in lane units
  };
  // Returns the column of bricks (p, q), limited to the bricks from `first` to `last`.
  VOXDAG_INLINE Column column(int p, int q, int first, int last) const {
    const int64_t height = height_of(p, q);
    const int64_t from = (height + (int64_t{1} << kColumnBits)) >> (kColumnBits + 2);
    const int64_t to = (height + reach_) >> (kColumnBits + 2);
    return {p,
            q,
            from > first ? from : first,
            to < last ? to : last,
            static_cast<int>(height >> (kColumnBits + 2)),
            static_cast<int>(height >> (kColumnBits - kHeightBits)) & ((4 << kHeightBits) - 1)};
  }

  // Returns `c`, a Column of another plane with the same normal, with `within` replaced by this
  // plane's value. This plane's height must be at most half a voxel above the other plane's height.
  VOXDAG_INLINE Column in_bricks_of(Column c) const {
    c.within = static_cast<int>(height_of(c.p, c.q) >> (kColumnBits - kHeightBits)) -
               c.brick * (4 << kHeightBits);
    return c;
  }

  // The heights of the 16 voxel columns, with a lane for each of them.
  struct Lanes {
    __m256i below, top;
    bool is_corrected;  // true if some lanes were computed exactly; they have no fractions
  };
  VOXDAG_INLINE Lanes lanes(const Column& c) const {
    const __m256i base = _mm256_set1_epi16(static_cast<int16_t>(c.within));
    Lanes out{_mm256_add_epi16(base, below_lanes_), _mm256_add_epi16(base, top_lanes_), false};
    const __m256i raised = _mm256_add_epi16(out.below, _mm256_set1_epi16(kBelowDoubt));
    const __m256i lowered = _mm256_sub_epi16(out.top, _mm256_set1_epi16(kTopDoubt));
    const __m256i differ =
        _mm256_or_si256(_mm256_xor_si256(raised, out.below), _mm256_xor_si256(lowered, out.top));
    if (!_mm256_testz_si256(differ, whole())) [[unlikely]] {
      divide_exactly(c.p, c.q, c.brick, _mm256_and_si256(differ, whole()), out.below, out.top);
      out.is_corrected = true;
    }
    return out;
  }
  // Returns the HeightBounds (sides.h) of the 16 voxel columns.
  static VOXDAG_INLINE HeightBounds bounds_of(const Lanes& lanes) {
    // The result for the top is its distance from the highest voxel, 15 - top. This is `top` with
    // its four bits inverted.
    return _mm256_packus_epi16(
        _mm256_srli_epi16(lanes.below, kHeightBits),
        _mm256_srli_epi16(_mm256_andnot_si256(lanes.top, whole()), kHeightBits));
  }
  // Does the same for a column of bricks. Voxel columns whose lane of `outer` is all ones have no
  // voxels.
  VOXDAG_INLINE HeightBounds bounds(const Column& c, __m256i outer) const {
    Lanes at = lanes(c);
    at.below = _mm256_or_si256(at.below, outer);
    return bounds_of(at);
  }

 private:
  static constexpr int P = kP<D>, Q = kQ<D>;

  // The bits of a lane above the fraction of a voxel.
  static VOXDAG_INLINE __m256i whole() {
    return _mm256_set1_epi16(static_cast<int16_t>(0xffff << kHeightBits));
  }
  VOXDAG_INLINE int64_t height_of(int p, int q) const {
    return origin_ + step_p_ * p + step_q_ * q;
  }

  // Safety margins in units of a lane. With them, `below` and `top` in bounds() never exclude a
  // touched voxel. They allow for three roundings (a column's base is truncated to a whole unit,
  // below_lanes_ are rounded, top_lanes_ are truncated) and for 0.02 units of rounding in floats:
  //   below   is in (y - 2.02, y - 0.02], see also SideCrossings (thin_by_columns.h). It can be on
  //   the wrong side of a whole number of voxels
  //           that is 1 or 2 units above it.
  //   top     is in (y + width / n_D + 0.02, y + width / n_D + 2.02]. It can be on the wrong side
  //           of a whole number of voxels that is 0, 1 or 2 units below it.
  static constexpr double kLowered = 0.52;
  static constexpr float kTopRaised = 2.54f;
  static constexpr int16_t kBelowDoubt = 2, kTopDoubt = 3;

  // Sets below_lanes_ and top_lanes_ to the heights of the 16 voxel columns, relative to the lowest
  // of these columns. sp and sq are the magnitudes of the plane's slopes along p and q, and p_falls
  // and q_falls are true if the height falls along the axis.
  VOXDAG_INLINE void set_lanes(bool p_falls, float sp, bool q_falls, float sq, float width) {
    const __m256 p_low =
        p_falls ? _mm256_setr_ps(3, 2, 3, 2, 3, 2, 3, 2) : _mm256_setr_ps(0, 1, 0, 1, 0, 1, 0, 1);
    const __m256 p_high = _mm256_add_ps(p_low, _mm256_set1_ps(p_falls ? -2.0f : 2.0f));
    const __m256 q_both =
        q_falls ? _mm256_setr_ps(3, 3, 2, 2, 1, 1, 0, 0) : _mm256_setr_ps(0, 0, 1, 1, 2, 2, 3, 3);
    const __m256 from_q = _mm256_mul_ps(q_both, _mm256_set1_ps(sq));
    const __m256 low = _mm256_add_ps(_mm256_mul_ps(p_low, _mm256_set1_ps(sp)), from_q);
    const __m256 high = _mm256_add_ps(_mm256_mul_ps(p_high, _mm256_set1_ps(sp)), from_q);
    const auto lanes = [&](float more) {
      const __m256 vmore = _mm256_set1_ps(more);
      return _mm256_packus_epi32(_mm256_cvttps_epi32(_mm256_add_ps(low, vmore)),
                                 _mm256_cvttps_epi32(_mm256_add_ps(high, vmore)));
    };
    below_lanes_ = lanes(0.5f);
    top_lanes_ = lanes(width + kTopRaised);
  }

  // Replaces the lanes of `below` and `top` by exact heights for the voxel columns whose lanes in
  // `doubtful` are not 0.
  [[gnu::noinline]] void divide_exactly(int p, int q, int brick, __m256i doubtful, __m256i& below,
                                        __m256i& top) const {
    const __m256i certain = _mm256_cmpeq_epi16(doubtful, _mm256_setzero_si256());
    const int64_t n = normal_[D];
    // The mask has two bits per lane, of which 0x55555555 selects one.
    for (uint32_t rest = ~static_cast<uint32_t>(_mm256_movemask_epi8(certain)) & 0x55555555u;
         rest != 0; rest &= rest - 1) {
      const int column = __builtin_ctz(rest) / 2;
      const int64_t at_zero = lowest_ + normal_[P] * (4 * p + column_p(column)) +
                              normal_[Q] * (4 * q + column_q(column));
      const int64_t exact_below = floor_divide(-at_zero - 1, n) - 4 * brick;
      const int64_t exact_top = floor_divide(width_ - at_zero, n) - 4 * brick;
      const __m256i lane = load(kLanes.only[column]);
      const auto put = [lane](__m256i& into, int64_t height) {
        into = _mm256_blendv_epi8(
            into, _mm256_set1_epi16(static_cast<int16_t>(height << kHeightBits)), lane);
      };
      put(below, exact_below);
      put(top, exact_top);
    }
  }

  static int64_t floor_divide(int64_t a, int64_t b) {
    const int64_t quotient = a / b;
    return quotient - (quotient * b > a ? 1 : 0);
  }

  const int64_t (&normal_)[3];
  const int64_t lowest_, width_;
  // The height of the column of bricks (p, q) is origin_ + step_p_ p + step_q_ q, with kColumnBits
  // bits for the fraction of a voxel. This is the y of its lowest voxel column, minus kLowered
  // units of a lane. The error is less than 2^-30 voxel after 16 columns of bricks.
  int64_t origin_, step_p_, step_q_;
  // An upper bound of the distance from the height of a column of bricks to the highest `top` (see
  // bounds()) of its voxel columns.
  int64_t reach_;
  __m256i below_lanes_, top_lanes_;
};

}  // namespace
}  // namespace voxdag::cpu
