#include "query/ray_packet.h"

#include <bit>

#include "core/base/popcount8.h"
#include "query/double_pair.h"

namespace voxdag::query {
namespace {

// In a cell that no more rays cross, a packet gains nothing; measured.
constexpr int kFewRays = 2;

constexpr uint64_t bit_of(int ray) { return uint64_t{1} << ray; }

// Calls body(i) for the first of each pair of rays in those eighths of the packet that have rays.
template <class Body>
void for_each_pair(uint64_t rays, const Body& body) {
  for (int first = 0; first < 64; first += 8)
    if (rays >> first & 255)
      for (int i = first; i < first + 8; i += 2) body(i);
}

}  // namespace

uint64_t RayPacket::cast(std::span<const Ray> rays, Hit* hits) {
  if (dag_.empty() || rays.empty()) return 0;
  hits_ = hits;
  found_ = single_ = 0;
  load(rays);
  uint64_t left = ~uint64_t{0} >> (kRays - rays.size());
  while (left != 0) {
    mirror_ = mirrored_[std::countr_zero(left)].mirror;
    uint64_t alike = 0;
    for (uint64_t m = left; m != 0; m &= m - 1)
      if (mirrored_[std::countr_zero(m)].mirror == mirror_) alike |= m & -m;
    left &= ~alike;
    cast_alike(alike);
  }
  const RayCaster caster(dag_);
  for (uint64_t m = single_; m != 0; m &= m - 1) {
    const int ray = std::countr_zero(m);
    if (caster.cast(rays[static_cast<size_t>(ray)], {stop_size_, 0}, t_min_, t_max_, hits[ray]))
      found_ |= bit_of(ray);
  }
  return found_;
}

// Lanes without a ray have numbers too, which nobody looks at.
void RayPacket::load(std::span<const Ray> rays) {
  const double edge = static_cast<double>(dag_.resolution());
  for (size_t i = 0; i < kRays; ++i) {
    mirrored_[i] = MirroredRay(rays[i < rays.size() ? i : 0], edge);
    for (int axis = 0; axis < 3; ++axis) {
      origin_[axis][i] = mirrored_[i].origin[axis];
      inverse_[axis][i] = mirrored_[i].inverse[axis];
      low_[axis][i] = mirrored_[i].time_of(axis, 0);
      high_[axis][i] = mirrored_[i].time_of(axis, edge);
    }
  }
}

// Casts rays whose directions have the same signs.
void RayPacket::cast_alike(uint64_t rays) {
  ended_ = 0;
  const Planes planes{{low_[0], low_[1], low_[2]}, {high_[0], high_[1], high_[2]}};
  uint64_t inside, touching;
  crossing(planes, rays, inside, touching);
  single_ |= touching;
  if (inside == 0) return;
  const double low[3] = {0, 0, 0};
  const double edge = static_cast<double>(dag_.resolution());
  if (dag_.grid_levels() == 2 || edge <= stop_size_ || std::popcount(inside) <= kFewRays)
    walk_apart(0, low, edge, 0, planes, inside);
  else
    visit(0, low, edge, 0, planes, inside);
}

// Which rays have an interval in a cell, and which have one of length 0.
void RayPacket::crossing(const Planes& planes, uint64_t rays, uint64_t& inside,
                         uint64_t& touching) const {
  const DoublePair t_min = DoublePair::of(t_min_), t_max = DoublePair::of(t_max_);
  const double *const *const low = planes.low, *const *const high = planes.high;
  inside = touching = 0;
  for_each_pair(rays, [&](int i) {
    const DoublePair in = max(max(DoublePair::load(low[0] + i), DoublePair::load(low[1] + i)),
                              max(DoublePair::load(low[2] + i), t_min));
    const DoublePair out = min(min(DoublePair::load(high[0] + i), DoublePair::load(high[1] + i)),
                               min(DoublePair::load(high[2] + i), t_max));
    inside |= uint64_t{less(in, out)} << i;
    touching |= uint64_t{equal(in, out)} << i;
  });
  inside &= rays;
  touching &= rays;
}

void RayPacket::pass_middle(uint32_t depth, const double (&low)[3], double half, uint64_t rays) {
  for (int axis = 0; axis < 3; ++axis) {
    const DoublePair plane = DoublePair::of(low[axis] + half);
    const double *const origin = origin_[axis], *const inverse = inverse_[axis];
    double* const middle = middle_[depth][axis];
    for_each_pair(rays, [&](int i) {
      ((plane - DoublePair::load(origin + i)) * DoublePair::load(inverse + i)).store(middle + i);
    });
  }
}

// Visits the node at `depth`, which all of `rays` enter, and what is below it.
void RayPacket::visit(uint32_t depth, const double (&low)[3], double size, uint64_t content,
                      const Planes& planes, uint64_t rays) {
  struct Child {
    uint64_t content, rays;
    Planes planes;
    double low[3];
  };
  const DagView::Children occupied = dag_.children(depth, content);
  const double half = size / 2;
  pass_middle(depth, low, half, rays);
  Child children[8];
  int count = 0;
  // All children that are crossed begin to be loaded before the first is visited.
  for (int index = 0; index < 8; ++index) {
    if (!occupied.has(index ^ mirror_)) continue;
    Child& child = children[count];
    for (int axis = 0; axis < 3; ++axis) {
      const bool upper = index & 4 >> axis;
      child.planes.low[axis] = upper ? middle_[depth][axis] : planes.low[axis];
      child.planes.high[axis] = upper ? planes.high[axis] : middle_[depth][axis];
      child.low[axis] = upper ? low[axis] + half : low[axis];
    }
    uint64_t touching;
    crossing(child.planes, rays & ~ended_, child.rays, touching);
    single_ |= touching;
    ended_ |= touching;
    if (child.rays == 0) continue;
    child.content = dag_.offset(occupied, index ^ mirror_);
    dag_.prefetch(depth + 1, child.content);
    ++count;
  }
  const bool apart = depth + 3 == dag_.grid_levels() || half <= stop_size_;
  for (int i = 0; i < count; ++i) {
    const Child& child = children[i];
    const uint64_t still = child.rays & ~ended_;
    if (still == 0) continue;
    if (apart || std::popcount(still) <= kFewRays)
      walk_apart(depth + 1, child.low, half, child.content, child.planes, still);
    else
      visit(depth + 1, child.low, half, child.content, child.planes, still);
  }
}

// Casts each of the rays through the cell by itself.
void RayPacket::walk_apart(uint32_t depth, const double (&low)[3], double size, uint64_t content,
                           const Planes& planes, uint64_t rays) {
  for (; rays != 0; rays &= rays - 1) {
    const int ray = std::countr_zero(rays);
    double t = t_min_, out[3];
    int entered_by = -1;
    bool tie = false;
    for (int axis = 0; axis < 3; ++axis) {
      const double in = planes.low[axis][ray];
      out[axis] = planes.high[axis][ray];
      tie = in == t || (tie && in < t);
      if (in <= t) continue;
      t = in;
      entered_by = axis;
    }
    if (tie) {
      single_ |= bit_of(ray);
    } else {
      RayWalk walk(dag_, mirrored_[ray], {stop_size_, 0}, t_max_);
      if (!walk.run_below(depth, low, size, content, out, t, entered_by, hits_[ray])) continue;
      found_ |= bit_of(ray);
    }
    ended_ |= bit_of(ray);
  }
}

}  // namespace voxdag::query
