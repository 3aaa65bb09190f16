// Computes which children of a cell a ray crosses, from the planes that bound the children. The
// planes are stored in two vectors of four doubles: one for the lower and one for the upper
// children. A vector has a number for each of x, y and z; the fourth number is not used. Several
// source files include this header, each compiled for a different instruction set. So all functions
// of this header have internal linkage: the linker must not replace a function by its version for
// another instruction set.
#pragma once

#include <cstdint>

#include "query/rays/packet_job.h"

#define VOXDAG_INLINE __attribute__((always_inline)) inline

namespace voxdag::query {
namespace {

// Masks of a cell's children, mirrored like the ray (packet_job.h). A ray's interval in a child is
// the range of the ray's parameters t in the child. `inside`: children in which this interval has a
// positive length. `touching`: children in which its length is 0.
struct Crossed {
  uint32_t inside, touching;
};

// The planes at which rays enter a cell's children, or the planes at which they leave the children.
// On each axis, a cell has lower and upper children; `lower` has the planes of the lower children,
// and `upper` the planes of the upper children. Each has one number for the x axis, one for y and
// one for z; the fourth number has no meaning. The numbers are coordinates of planes, or a ray's
// parameters at the planes.
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

// Returns the children that a ray crosses between t_min and t_max. `in` and `out` are the ray's
// parameters at the planes at which it enters and leaves the children. To test many rays together,
// pass bounds of their parameters: lower bounds of `in` with upper bounds of `out` give all
// children that some ray can cross, and the opposite bounds give the children that all rays cross.
template <class Four>
VOXDAG_INLINE Crossed cross(FourPlanes<Four> in, FourPlanes<Four> out, double t_min, double t_max) {
  const Four first = Four::of(t_min), last = Four::of(t_max);
  const Four in_xz = max(max(blend_high(first_lane(in.lower), first_lane(in.upper)),
                             blend_odd(last_lane(in.lower), last_lane(in.upper))),
                         first);
  const Four out_xz = min(min(blend_high(first_lane(out.lower), first_lane(out.upper)),
                              blend_odd(last_lane(out.lower), last_lane(out.upper))),
                          last);
  const Four in0 = max(in_xz, middle_lane(in.lower)), in1 = max(in_xz, middle_lane(in.upper));
  const Four out0 = min(out_xz, middle_lane(out.lower)), out1 = min(out_xz, middle_lane(out.upper));
  return {less(in0, out0, in1, out1), equal(in0, out0, in1, out1)};
}

}  // namespace
}  // namespace voxdag::query
