// The planes of a cell as two vectors of four doubles, and a test of which children a ray crosses.
// Each source file that includes this header is compiled for a different instruction set, so
// everything here has internal linkage.
#pragma once

#include <cstdint>

#include "query/rays/packet_job.h"

#define VOXDAG_INLINE __attribute__((always_inline)) inline

namespace voxdag::query {
namespace {

// Masks of a cell's mirrored children. `inside`: children in which the ray has a nonempty interval.
// `touching`: children in which this interval has length 0.
struct Crossed {
  uint32_t inside, touching;
};

// Four numbers per set of planes: for the planes on the axes x, y and z; the fourth number has no
// meaning. `lower` is for the planes of a cell's lower children, `upper` for those of its upper
// children. An object holds either the planes by which rays enter the children or the planes by
// which they leave them, as coordinates or as the rays' parameters at these planes.
template <class Four>
struct FourPlanes {
  Four lower, upper;
  static FourPlanes of(double all) { return {Four::of(all), Four::of(all)}; }
  // Uses the same four numbers for `lower` and `upper`.
  static FourPlanes twice(const double* four) { return {Four::load(four), Four::load(four)}; }
  // Returns the planes at which rays enter the children of a cell. `low` is the cell's low corner,
  // `half` the edge of its children.
  static FourPlanes of_cell(Int4 low, double half) {
    const Four l = Four::from(low);
    return {l, l + Four::of(half)};
  }
};
template <class Four>
VOXDAG_INLINE FourPlanes<Four> operator+(FourPlanes<Four> x, FourPlanes<Four> y) {
  return {x.lower + y.lower, x.upper + y.upper};
}
template <class Four>
VOXDAG_INLINE FourPlanes<Four> operator-(FourPlanes<Four> x, FourPlanes<Four> y) {
  return {x.lower - y.lower, x.upper - y.upper};
}
template <class Four>
VOXDAG_INLINE FourPlanes<Four> operator*(FourPlanes<Four> x, FourPlanes<Four> y) {
  return {x.lower * y.lower, x.upper * y.upper};
}
template <class Four>
VOXDAG_INLINE FourPlanes<Four> max(FourPlanes<Four> x, FourPlanes<Four> y) {
  return {max(x.lower, y.lower), max(x.upper, y.upper)};
}
template <class Four>
VOXDAG_INLINE FourPlanes<Four> min(FourPlanes<Four> x, FourPlanes<Four> y) {
  return {min(x.lower, y.lower), min(x.upper, y.upper)};
}

// Returns the children that a ray with these parameters crosses. For a test of many rays, `in` may
// be lower bounds of the parameters, and `out` upper bounds.
template <class Four>
VOXDAG_INLINE Crossed cross(FourPlanes<Four> in, FourPlanes<Four> out, double t_min, double t_max) {
  const Four first = Four::of(t_min), last = Four::of(t_max);
  const Four in_yz = max(max(blend_high(middle_lane(in.lower), middle_lane(in.upper)),
                             blend_odd(last_lane(in.lower), last_lane(in.upper))),
                         first);
  const Four out_yz = min(min(blend_high(middle_lane(out.lower), middle_lane(out.upper)),
                              blend_odd(last_lane(out.lower), last_lane(out.upper))),
                          last);
  const Four in0 = max(in_yz, first_lane(in.lower)), in1 = max(in_yz, first_lane(in.upper));
  const Four out0 = min(out_yz, first_lane(out.lower)), out1 = min(out_yz, first_lane(out.upper));
  return {less(in0, out0) | less(in1, out1) << 4, equal(in0, out0) | equal(in1, out1) << 4};
}

}  // namespace
}  // namespace voxdag::query
