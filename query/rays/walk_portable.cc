#include <cstring>

#include "query/rays/double_pair.h"
#include "query/rays/packet_walk.h"

namespace voxdag::query {
namespace {

struct PlainFour {
  DoublePair a, b;
  static PlainFour load(const double* p) { return {DoublePair::load(p), DoublePair::load(p + 2)}; }
  static PlainFour of(double all) { return {DoublePair::of(all), DoublePair::of(all)}; }
  static PlainFour from(Int4 p) {
    int32_t four[4];
    std::memcpy(four, &p, sizeof four);
    return {DoublePair::from(four), DoublePair::from(four + 2)};
  }
  void store(double* p) const {
    a.store(p);
    b.store(p + 2);
  }
};
VOXDAG_INLINE PlainFour operator-(PlainFour x, PlainFour y) { return {x.a - y.a, x.b - y.b}; }
VOXDAG_INLINE PlainFour operator+(PlainFour x, PlainFour y) { return {x.a + y.a, x.b + y.b}; }
VOXDAG_INLINE PlainFour operator*(PlainFour x, PlainFour y) { return {x.a * y.a, x.b * y.b}; }
VOXDAG_INLINE PlainFour max(PlainFour x, PlainFour y) { return {max(x.a, y.a), max(x.b, y.b)}; }
VOXDAG_INLINE PlainFour min(PlainFour x, PlainFour y) { return {min(x.a, y.a), min(x.b, y.b)}; }
VOXDAG_INLINE unsigned less(PlainFour x, PlainFour y) {
  return less(x.a, y.a) | less(x.b, y.b) << 2;
}
// Returns the results of two comparisons as a mask of children: `lower` has the results for the
// children that are lower on the y axis, and `upper` for those that are upper.
VOXDAG_INLINE uint32_t children(uint32_t lower, uint32_t upper) {
  return (lower & 3) | (upper & 3) << 2 | (lower & 12) << 2 | (upper & 12) << 4;
}
VOXDAG_INLINE uint32_t less(PlainFour x0, PlainFour y0, PlainFour x1, PlainFour y1) {
  return children(less(x0, y0), less(x1, y1));
}
VOXDAG_INLINE uint32_t equal(PlainFour x0, PlainFour y0, PlainFour x1, PlainFour y1) {
  return children(equal(x0.a, y0.a) | equal(x0.b, y0.b) << 2, equal(x1.a, y1.a) | equal(x1.b, y1.b)
                                                                                      << 2);
}
VOXDAG_INLINE PlainFour first_lane(PlainFour x) { return {firsts(x.a), firsts(x.a)}; }
VOXDAG_INLINE PlainFour middle_lane(PlainFour x) { return {seconds(x.a), seconds(x.a)}; }
VOXDAG_INLINE PlainFour last_lane(PlainFour x) { return {firsts(x.b), firsts(x.b)}; }
VOXDAG_INLINE PlainFour blend_high(PlainFour x, PlainFour y) { return {x.a, y.b}; }
VOXDAG_INLINE PlainFour blend_odd(PlainFour x, PlainFour y) {
  return {first_second(x.a, y.a), first_second(x.b, y.b)};
}

}  // namespace

void walk_packet_portable(PacketJob& job, uint64_t rays) {
  PacketWalk<PlainFour>(job, rays).run(rays);
}

#ifndef __x86_64__
WalkPacket walk_packet_avx2() { return nullptr; }
#endif

}  // namespace voxdag::query
