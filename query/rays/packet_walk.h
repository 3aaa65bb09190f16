// The walk of a packet of rays, for any implementation of four doubles at once. Each source that
// includes this is compiled for its own instructions, so everything here has internal linkage.
//
// Large cells are visited depth first, once for all rays that may cross them: bounds of all rays
// together leave out most children, and each ray is tested with those that remain if there are
// several. Where few rays are left, or cells are small and nodes are cache misses, each ray
// descends by itself through its cells in their order, so that it loads nothing behind its hit.
// Rays take turns, a step each: what a ray enters next is under way from memory while the others
// step.
//
// A cell is crossed where a ray has an interval in it that is not empty. One of length 0 in an
// occupied cell, or two planes passed at the parameter of a hit, mean that the path from the root
// decides: such a ray is given up, and is cast by itself.
#pragma once

#include <limits>

#include "core/base/popcount8.h"
#include "core/dag/brick.h"
#include "query/rays/packet_job.h"

#define VOXDAG_INLINE __attribute__((always_inline)) inline

namespace voxdag::query {
namespace {

// The child mask of a node with children in mirrored order.
struct MirroredMasks {
  uint8_t of[8][256] = {};
  constexpr MirroredMasks() {
    for (int mirror = 0; mirror < 8; ++mirror)
      for (int mask = 0; mask < 256; ++mask)
        for (int i = 0; i < 8; ++i)
          if (mask >> i & 1) of[mirror][mask] |= static_cast<uint8_t>(1 << (i ^ mirror));
  }
};
constexpr MirroredMasks kMirroredMasks;

// Of the children of a cell, mirrored: those in which a ray has an interval, and one of length 0.
struct Crossed {
  uint32_t inside, touching;
};

template <class Four>
class PacketWalk {
 public:
  PacketWalk(PacketJob& job, uint64_t rays)
      : job_(job),
        mirrored_(kMirroredMasks.of[job.mirror]),
        brick_depth_(job.grid_levels - kBrickLevels) {
    bound(rays);
  }

  void run(uint64_t rays) {
    const int32_t low[4] = {0, 0, 0, 0};
    if (job_.leaf_depth == 1 || brick_depth_ == 0)
      push(0, low, 0, rays);
    else
      visit(0, low, int32_t{1} << job_.grid_levels, 0, rays);
    finish_descents();
  }

 private:
  // Measured: so few rays part in any cell, all do in those of kSmallest voxels per edge.
  static constexpr int kFewRays = 8;
  static constexpr int32_t kSmallest = 8;

  struct Child {
    int32_t low[4];
    uint64_t offset, rays;
  };

  VOXDAG_INLINE static int first_of(uint64_t bits) { return __builtin_ctzll(bits); }
  VOXDAG_INLINE static int count_of(uint64_t bits) {
    int count = 0;
    for (; bits != 0; bits >>= 8) count += kPopcount8[bits & 255];
    return count;
  }

  // Bounds of the origins and inverse directions of all rays.
  void bound(uint64_t rays) {
    for (int axis = 0; axis < 3; ++axis) {
      constexpr double kInfinity = std::numeric_limits<double>::infinity();
      double o0 = kInfinity, o1 = -kInfinity, i0 = kInfinity, i1 = 0;
      for (uint64_t m = rays; m != 0; m &= m - 1) {
        const int r = first_of(m);
        const double o = job_.origin[axis][r], i = job_.inverse[axis][r];
        o0 = o < o0 ? o : o0;
        o1 = o > o1 ? o : o1;
        i0 = i < i0 ? i : i0;
        i1 = i > i1 ? i : i1;
      }
      low_origin_[axis] = o0;
      high_origin_[axis] = o1;
      low_inverse_[axis] = i0;
      high_inverse_[axis] = i1;
    }
    low_origin_[3] = high_origin_[3] = 0;
    low_inverse_[3] = high_inverse_[3] = 1;
  }

  // As DagView::Children; its functions are not for this instruction set.
  struct Node {
    uint32_t mask;
    const uint32_t* children;
    bool wide;
    VOXDAG_INLINE uint64_t child(int index) const {
      const int n = kPopcount8[mask & ((1u << index) - 1)];
      return wide ? children[2 * n] | static_cast<uint64_t>(children[2 * n + 1]) << 32
                  : children[n];
    }
  };
  VOXDAG_INLINE Node node(uint32_t depth, uint64_t offset) const {
    const PacketJob::Level& level = job_.levels[depth];
    if (offset >= level.count) job_.dag->corrupt(depth, offset);
    const uint32_t* const words = level.words + offset;
    const uint32_t mask = words[0];
    if (mask == 0 || mask > 255 ||
        uint64_t{kPopcount8[mask]} << level.wide_children >= level.count - offset)
      job_.dag->corrupt(depth, offset);
    return {mask, words + 1, level.wide_children};
  }
  VOXDAG_INLINE uint64_t brick(uint64_t offset) const {
    const PacketJob::Level& level = job_.levels[brick_depth_];
    if (level.count < 2 || offset > level.count - 2) job_.dag->corrupt(brick_depth_, offset);
    const uint64_t mask = level.words[offset] | static_cast<uint64_t>(level.words[offset + 1])
                                                    << 32;
    if (mask == 0) job_.dag->corrupt(brick_depth_, offset);
    return mask;
  }
  VOXDAG_INLINE void prefetch(uint32_t depth, uint64_t offset) const {
    const PacketJob::Level& level = job_.levels[depth];
    if (offset < level.count) __builtin_prefetch(level.words + offset);
  }

  // From the parameters of a cell's low, middle and high planes, x, y and z; those by which rays
  // enter may be lower bounds, those by which they leave upper ones.
  VOXDAG_INLINE static Crossed cross(Four low_in, Four middle_in, Four middle_out, Four high_out,
                                     Four t_min, Four t_end) {
    const Four in = max(blend_high(middle_lane(low_in), middle_lane(middle_in)),
                        blend_odd(last_lane(low_in), last_lane(middle_in)));
    const Four out = min(blend_high(middle_lane(middle_out), middle_lane(high_out)),
                         blend_odd(last_lane(middle_out), last_lane(high_out)));
    const Four in0 = max(in, max(first_lane(low_in), t_min));
    const Four in1 = max(in, max(first_lane(middle_in), t_min));
    const Four out0 = min(out, min(first_lane(middle_out), t_end));
    const Four out1 = min(out, min(first_lane(high_out), t_end));
    return {less(in0, out0) | less(in1, out1) << 4, equal(in0, out0) | equal(in1, out1) << 4};
  }

  // `low` has four numbers, of which the last does not matter.
  VOXDAG_INLINE Crossed cross_one(const int32_t* low, int ray, double half) const {
    const PacketRay& r = job_.rays[ray];
    const Four origin = Four::load(r.origin), inverse = Four::load(r.inverse), h = Four::of(half);
    const Four low_plane = Four::from(low);
    const Four middle_plane = low_plane + h;
    const Four l = (low_plane - origin) * inverse, m = (middle_plane - origin) * inverse,
               u = (middle_plane + h - origin) * inverse;
    return cross(l, m, m, u, Four::of(job_.t_min), Four::of(job_.t_max));
  }

  // Which children of a cell some ray may cross or touch. Rounding is monotonic, so that bounds of
  // parameters come from those of origins and inverse directions.
  VOXDAG_INLINE uint32_t cross_any(const int32_t* low, double half) const {
    const Four o0 = Four::load(low_origin_), o1 = Four::load(high_origin_),
               i0 = Four::load(low_inverse_), i1 = Four::load(high_inverse_), h = Four::of(half);
    const Four low_plane = Four::from(low);
    const Four middle_plane = low_plane + h, high_plane = middle_plane + h;
    const Four l = low_plane - o1, m = middle_plane - o1, n = middle_plane - o0,
               u = high_plane - o0;
    const Crossed crossed = cross(min(l * i0, l * i1), min(m * i0, m * i1), max(n * i0, n * i1),
                                  max(u * i0, u * i1), Four::of(job_.t_min), Four::of(job_.t_max));
    return crossed.inside | crossed.touching;
  }

  // Which of the rays cross a cell or touch it.
  VOXDAG_INLINE uint64_t crossing(const int32_t* low, double edge, uint64_t rays) const {
    Four low_plane[3], high_plane[3];
    for (int axis = 0; axis < 3; ++axis) {
      low_plane[axis] = Four::of(low[axis]);
      high_plane[axis] = Four::of(low[axis] + edge);
    }
    const Four t_min = Four::of(job_.t_min), t_max = Four::of(job_.t_max);
    uint64_t crossing = 0;
    for (int i = 0; i < kPacketRays; i += 4) {
      if ((rays >> i & 15) == 0) continue;
      Four in = t_min, out = t_max;
      for (int axis = 0; axis < 3; ++axis) {
        const Four o = Four::load(job_.origin[axis] + i), v = Four::load(job_.inverse[axis] + i);
        in = max(in, (low_plane[axis] - o) * v);
        out = min(out, (high_plane[axis] - o) * v);
      }
      crossing |= uint64_t{less(out, in) ^ 15} << i;
    }
    return crossing & rays;
  }

  VOXDAG_INLINE static void corner(const int32_t* low, int index, int32_t half, int32_t* out) {
    out[0] = low[0] + (index & 4 ? half : 0);
    out[1] = low[1] + (index & 2 ? half : 0);
    out[2] = low[2] + (index & 1 ? half : 0);
  }

  // Visits a node that all of `rays` may cross.
  void visit(uint32_t depth, const int32_t* low, int32_t edge, uint64_t offset, uint64_t rays) {
    const Node n = node(depth, offset);
    const int32_t half = edge / 2;
    uint32_t candidates = mirrored_[n.mask] & cross_any(low, half);
    const bool only = (candidates & (candidates - 1)) == 0;
    Child children[8];
    int count = 0;
    for (; candidates != 0; candidates &= candidates - 1) {
      const int index = first_of(candidates);
      Child& child = children[count];
      corner(low, index, half, child.low);
      child.rays = only ? rays : crossing(child.low, half, rays);
      if (child.rays == 0) continue;
      child.offset = n.child(index ^ job_.mirror);
      prefetch(depth + 1, child.offset);
      ++count;
    }
    const bool last =
        half <= kSmallest || depth + 2 == job_.leaf_depth || depth + 1 == brick_depth_;
    for (int i = 0; i < count; ++i) {
      const Child& child = children[i];
      const uint64_t left = child.rays & ~(job_.found | job_.single);
      if (left == 0) continue;
      if (last || count_of(left) <= kFewRays)
        push(depth + 1, child.low, child.offset, left);
      else
        visit(depth + 1, child.low, half, child.offset, left);
    }
  }

  // Lets rays part in a cell. Cells come in the order in which their rays cross them.
  void push(uint32_t depth, const int32_t* low, uint64_t offset, uint64_t rays) {
    for (; rays != 0; rays &= rays - 1) {
      const int ray = first_of(rays);
      RayDescent& descent = job_.descents[ray];
      const WaitingCell cell{{low[0], low[1], low[2], 0}, offset, depth, -1};
      if (under_way_ >> ray & 1) {
        const int at = waiting_++;
        job_.waiting[at] = cell;
        (descent.first_waiting < 0 ? descent.first_waiting
                                   : job_.waiting[descent.last_waiting].next) = at;
        descent.last_waiting = at;
      } else {
        under_way_ |= uint64_t{1} << ray;
        list_[count_++] = static_cast<uint8_t>(ray);
        begin(descent, cell);
      }
    }
    if (count_ + waiting_ >= PacketJob::kRoundCells) finish_descents();
  }

  VOXDAG_INLINE static void begin(RayDescent& descent, const WaitingCell& cell) {
    for (int axis = 0; axis < 3; ++axis) descent.low[axis] = cell.low[axis];
    descent.offset = cell.offset;
    descent.depth = cell.depth;
    descent.open = 0;
    descent.first_waiting = cell.next;
  }

  // One step of each ray after the other, until all have ended or left their cells.
  void finish_descents() {
    while (count_ > 0)
      for (int i = 0; i < count_;)
        if (step(list_[i]))
          ++i;
        else
          list_[i] = list_[--count_];
    under_way_ = 0;
    waiting_ = 0;
  }

  // The ray enters a cell; whether it continues, with the cell that `descent` has then.
  VOXDAG_INLINE bool step(int ray) {
    RayDescent& descent = job_.descents[ray];
    const uint32_t depth = descent.depth;
    if (depth == brick_depth_) {
      if (cast_in_brick(descent, ray)) return false;
    } else {
      const Node n = node(depth, descent.offset);
      const uint32_t occupied = mirrored_[n.mask];
      const int32_t half = int32_t{1} << (job_.grid_levels - depth - 1);
      if (depth + 1 == job_.leaf_depth) {
        if (cast_in(descent.low, half, ray, occupied, depth + 1)) return false;
      } else {
        const Crossed crossed = cross_one(descent.low, ray, half);
        if (crossed.touching & occupied) return !give_up(ray);
        if (const uint32_t in = crossed.inside & occupied) {
          enter_first(descent, depth, in, n);
          return true;
        }
      }
    }
    return enter_next(descent);
  }

  // Goes to the first of these children of the path's node at `depth`; the others are left.
  VOXDAG_INLINE void enter_first(RayDescent& descent, uint32_t depth, uint32_t in, const Node& n) {
    const int index = first_of(in);
    corner(descent.low, index, int32_t{1} << (job_.grid_levels - depth - 1), descent.low);
    descent.offset = n.child(index ^ job_.mirror);
    descent.depth = depth + 1;
    descent.left[depth] = static_cast<uint8_t>(in & (in - 1));
    descent.open &= ~(1u << depth);
    descent.open |= (descent.left[depth] != 0 ? 1u : 0u) << depth;
    descent.children[depth] = n.children;
    prefetch(depth + 1, descent.offset);
  }

  // From a cell without a hit to the next one; whether there is one.
  VOXDAG_INLINE bool enter_next(RayDescent& descent) {
    if (descent.open == 0) {
      if (descent.first_waiting < 0) return false;
      begin(descent, job_.waiting[descent.first_waiting]);
      return true;
    }
    const uint32_t depth = 31u - static_cast<uint32_t>(__builtin_clz(descent.open));
    const int32_t edge = int32_t{1} << (job_.grid_levels - depth);
    for (int axis = 0; axis < 3; ++axis) descent.low[axis] &= -edge;
    const uint32_t* const children = descent.children[depth];
    enter_first(descent, depth, descent.left[depth],
                {children[-1], children, job_.levels[depth].wide_children});
    return true;
  }

  // Whether the ray ends in this brick.
  VOXDAG_INLINE bool cast_in_brick(const RayDescent& cell, int ray) {
    const uint64_t mask = brick(cell.offset);
    const uint32_t occupied = mirrored_[octants(mask)];
    if (job_.leaf_depth == brick_depth_ + 1)
      return cast_in(cell.low, 2, ray, occupied, job_.leaf_depth);
    const Crossed crossed = cross_one(cell.low, ray, 2);
    if (crossed.touching & occupied) return give_up(ray);
    for (uint32_t in = crossed.inside & occupied; in != 0; in &= in - 1) {
      const int index = first_of(in);
      int32_t low[4] = {};
      corner(cell.low, index, 2, low);
      if (cast_in(low, 1, ray, mirrored_[mask >> 8 * (index ^ job_.mirror) & 255],
                  job_.grid_levels))
        return true;
    }
    return false;
  }

  // Whether the ray ends in a cell of these children.
  VOXDAG_INLINE bool cast_in(const int32_t* low, int32_t half, int ray, uint32_t occupied,
                             uint32_t depth) {
    const Crossed crossed = cross_one(low, ray, half);
    if (crossed.touching & occupied) return give_up(ray);
    const uint32_t in = crossed.inside & occupied;
    if (in == 0) return false;
    int32_t leaf[4];
    corner(low, first_of(in), half, leaf);
    return report(leaf, half, ray, depth);
  }

  // The ray ends here.
  bool give_up(int ray) {
    job_.single |= uint64_t{1} << ray;
    return true;
  }

  // The ray's hit is this cell, unless a tie decides about the face.
  VOXDAG_INLINE bool report(const int32_t* low, int32_t edge, int ray, uint32_t depth) {
    const PacketRay& r = job_.rays[ray];
    double t = job_.t_min;
    int entered_by = -1;
    bool tie = false;
    for (int axis = 0; axis < 3; ++axis) {
      const double in = (low[axis] - r.origin[axis]) * r.inverse[axis];
      tie = in == t || (tie && in < t);
      if (in <= t) continue;
      t = in;
      entered_by = axis;
    }
    if (tie) return give_up(ray);
    Hit& hit = job_.hits[ray];
    hit.t = t;
    hit.depth = depth;
    hit.axis = entered_by;
    const int32_t last = (int32_t{1} << job_.grid_levels) - edge;
    for (int axis = 0; axis < 3; ++axis)
      hit.cell[axis] =
          (job_.mirror & 4 >> axis ? last - low[axis] : low[axis]) >> (job_.grid_levels - depth);
    job_.found |= uint64_t{1} << ray;
    return true;
  }

  PacketJob& job_;
  const uint8_t (&mirrored_)[256];
  const uint32_t brick_depth_;
  // Rays that descend by themselves, as bits and as a list, and cells that wait for them.
  uint64_t under_way_ = 0;
  uint8_t list_[kPacketRays];
  int count_ = 0, waiting_ = 0;
  alignas(32) double low_origin_[4], high_origin_[4], low_inverse_[4], high_inverse_[4];
};

}  // namespace
}  // namespace voxdag::query
