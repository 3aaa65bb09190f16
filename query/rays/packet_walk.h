// The walk of a packet of rays through the DAG. The template parameter `Four` is a vector of four
// doubles. Each source file that includes this header is compiled for a different instruction set,
// so all functions of this header have internal linkage (four_planes.h).
//
// The walk visits large cells depth first, once for all rays that can cross them. Bounds of the
// origins and directions of all rays exclude most children. If several children remain, each ray is
// tested with each of them. If only few rays remain in a cell, each ray descends separately through
// its cells, nearest first, and so never loads a cell behind its hit. The separate rays take turns,
// one step each: while other rays take their steps, memory loads the ray's next cell.
//
// A ray's interval in a cell is the range of the ray's parameter t in the cell; the ray crosses the
// cell if this range is not empty. In two cases RayCaster's result depends on the path from the
// root to the cell: if a ray's interval in an occupied cell has length 0, and if the ray enters the
// hit cell through two faces at the same t. In these cases the walk gives the ray up: it removes
// the ray from the packet, and RayPacket casts the ray with RayCaster.
#pragma once

#include <limits>

#include "core/base/popcount8.h"
#include "core/dag/brick.h"
#include "query/rays/four_planes.h"
#include "query/rays/packet_job.h"

namespace voxdag::query {
namespace {

// A table that mirrors child masks: the element of[mirror][mask] is `mask` with bit i moved to the
// position i ^ mirror, for all i.
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

// kUpperOn[index] has all bits set on the axes on which child `index` is an upper child, and 0 on
// the other axes. A child index has bit 2 for x, bit 1 for y and bit 0 for z.
constexpr Int4 kUpperOn[8] = {{0, 0, 0, 0},  {0, 0, -1, 0},  {0, -1, 0, 0},  {0, -1, -1, 0},
                              {-1, 0, 0, 0}, {-1, 0, -1, 0}, {-1, -1, 0, 0}, {-1, -1, -1, 0}};

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
    const Int4 low = {0, 0, 0, 0};
    if (job_.leaf_depth == 1 || brick_depth_ == 0)
      push(0, low, 0, rays);
    else
      visit(0, low, int32_t{1} << job_.grid_levels, 0, rays);
    finish_descents();
  }

 private:
  // In a cell with at most this number of rays (chosen by measurement), the rays continue
  // separately. In a brick, they always continue separately.
  static constexpr int kFewRays = 8;

  using Planes = FourPlanes<Four>;
  struct Child {
    Int4 low;
    uint64_t offset, rays;
  };

  VOXDAG_INLINE static int first_of(uint64_t bits) { return __builtin_ctzll(bits); }
#ifdef __POPCNT__
  VOXDAG_INLINE static int count_of(uint64_t bits) { return __builtin_popcountll(bits); }
  VOXDAG_INLINE static uint32_t count_of_8(uint32_t bits) {
    return static_cast<uint32_t>(__builtin_popcount(bits));
  }
#else
  VOXDAG_INLINE static int count_of(uint64_t bits) {
    int count = 0;
    for (; bits != 0; bits >>= 8) count += kPopcount8[bits & 255];
    return count;
  }
  VOXDAG_INLINE static uint32_t count_of_8(uint32_t bits) { return kPopcount8[bits]; }
#endif
  VOXDAG_INLINE static Int4 all(int32_t number) { return Int4{number, number, number, number}; }

  // Computes bounds of the origins and of the inverse directions of the job's rays whose bits are
  // set in `rays`.
  VOXDAG_INLINE void bound(uint64_t rays) {
    Four lows[6], highs[6];
    for (Four& low : lows) low = Four::of(std::numeric_limits<double>::infinity());
    for (Four& high : highs) high = Four::of(-std::numeric_limits<double>::infinity());
    const auto extend = [&](const auto& numbers_of) {
      for (int j = 0; j < 6; ++j) {
        const Four x = numbers_of(j < 3 ? job_.origin[j] : job_.inverse[j - 3]);
        lows[j] = min(lows[j], x);
        highs[j] = max(highs[j], x);
      }
    };
    for (int i = 0; i < kPacketRays; i += 4) {
      if ((rays >> i & 15) == 15) {
        extend([&](const double* numbers) { return Four::load(numbers + i); });
        continue;
      }
      for (uint64_t left = rays >> i & 15; left != 0; left &= left - 1)
        extend([&](const double* numbers) { return Four::of(numbers[i + first_of(left)]); });
    }
    for (int axis = 0; axis < 3; ++axis) {
      reduce(lows[axis], highs[axis], low_origin_[axis], high_origin_[axis]);
      reduce(lows[3 + axis], highs[3 + axis], low_inverse_[axis], high_inverse_[axis]);
    }
    low_origin_[3] = high_origin_[3] = 0;
    low_inverse_[3] = high_inverse_[3] = 1;
  }
  static void reduce(const Four& lows, const Four& highs, double& low, double& high) {
    alignas(64) double l[4], h[4];
    lows.store(l);
    highs.store(h);
    low = l[0];
    high = h[0];
    for (int i = 1; i < 4; ++i) {
      low = l[i] < low ? l[i] : low;
      high = h[i] > high ? h[i] : high;
    }
  }

  // Replaces DagView::Children, because the functions of DagView are not compiled for this
  // instruction set.
  struct Node {
    uint32_t mask;
    const uint32_t* children;
    bool wide;
    VOXDAG_INLINE uint64_t child(int index) const {
      const uint32_t n = count_of_8(mask & ((1u << index) - 1));
      return wide ? children[2 * n] | static_cast<uint64_t>(children[2 * n + 1]) << 32
                  : children[n];
    }
  };
  VOXDAG_INLINE Node node(uint32_t depth, uint64_t offset) const {
    const PacketJob::Level& level = job_.levels[depth];
    if (offset >= level.any_node) check_node(depth, offset);
    const uint32_t* const words = level.words + offset;
    const uint32_t mask = words[0];
    if (mask - 1 >= 255) job_.dag->corrupt(depth, offset);
    return {mask, words + 1, level.wide_children};
  }
  // Throws Error{kCorrupt} unless the node at `offset` is completely inside its level. node() calls
  // this function only for offsets near the end of the level.
  __attribute__((noinline)) void check_node(uint32_t depth, uint64_t offset) const {
    const PacketJob::Level& level = job_.levels[depth];
    if (offset >= level.count || uint64_t{kPopcount8[level.words[offset] & 255]}
                                         << level.wide_children >=
                                     level.count - offset)
      job_.dag->corrupt(depth, offset);
  }
  VOXDAG_INLINE uint64_t brick(uint64_t offset) const {
    const PacketJob::Level& level = job_.levels[brick_depth_];
    if (level.count < 2 || offset > level.count - 2) job_.dag->corrupt(brick_depth_, offset);
    const uint64_t mask = level.words[offset] | static_cast<uint64_t>(level.words[offset + 1])
                                                    << 32;
    if (mask == 0) job_.dag->corrupt(brick_depth_, offset);
    return mask;
  }
  // Prefetches a node or brick. An offset outside the level is harmless, because a prefetch never
  // faults.
  VOXDAG_INLINE void prefetch(uint32_t depth, uint64_t offset) const {
    __builtin_prefetch(reinterpret_cast<const void*>(
        reinterpret_cast<uintptr_t>(job_.levels[depth].words) + 4 * offset));
  }

  VOXDAG_INLINE Crossed cross_one(Int4 low, int ray, double half) const {
    const PacketRay& r = job_.rays[ray];
    const Planes origin = Planes::twice(r.origin), inverse = Planes::twice(r.inverse);
    const Planes planes = Planes::of_cell(low, half);
    return cross((planes - origin) * inverse, (planes + Planes::of(half) - origin) * inverse,
                 job_.t_min, job_.t_max);
  }

  // Returns the children of a cell that at least one ray can cross or touch. Computes bounds of the
  // ray parameters from the bounds of origins and inverse directions. These bounds are valid in
  // spite of rounding, because rounding is monotonic.
  VOXDAG_INLINE uint32_t cross_any(Int4 low, double half) const {
    const Planes i0 = Planes::twice(low_inverse_), i1 = Planes::twice(high_inverse_);
    const Planes planes = Planes::of_cell(low, half);
    const Planes in = planes - Planes::twice(high_origin_),
                 out = planes + Planes::of(half) - Planes::twice(low_origin_);
    const Crossed crossed =
        cross(min(in * i0, in * i1), max(out * i0, out * i1), job_.t_min, job_.t_max);
    return crossed.inside | crossed.touching;
  }
  // Returns children of a cell that all rays cross. The bounds are not tight, so the mask does not
  // always have all of these children.
  VOXDAG_INLINE uint32_t cross_all(Int4 low, double half) const {
    const Planes i0 = Planes::twice(low_inverse_), i1 = Planes::twice(high_inverse_);
    const Planes planes = Planes::of_cell(low, half);
    const Planes in = planes - Planes::twice(low_origin_),
                 out = planes + Planes::of(half) - Planes::twice(high_origin_);
    return cross(max(in * i0, in * i1), min(out * i0, out * i1), job_.t_min, job_.t_max).inside;
  }

  // Returns the subset of `rays` that cross or touch the cell with this low corner and edge.
  VOXDAG_INLINE uint64_t crossing(Int4 low, double edge, uint64_t rays) const {
    Four low_plane[3], high_plane[3];
    for (int axis = 0; axis < 3; ++axis) {
      low_plane[axis] = Four::of(low[axis]);
      high_plane[axis] = Four::of(low[axis] + edge);
    }
    const Four t_min = Four::of(job_.t_min), t_max = Four::of(job_.t_max);
    uint64_t crossing = 0;
    for (uint64_t groups = groups_of(rays); groups != 0; groups &= groups - 1) {
      const int i = first_of(groups);
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
  // Divides the 64 bits of `rays` into groups of four. Returns a mask with the lowest bit of each
  // group that contains a ray.
  VOXDAG_INLINE static uint64_t groups_of(uint64_t rays) {
    rays |= rays >> 1;
    return (rays | rays >> 2) & 0x1111111111111111;
  }

  VOXDAG_INLINE static Int4 corner(Int4 low, int index, int32_t half) {
    return low + (kUpperOn[index] & all(half));
  }

  // Visits a node. `rays` are the rays that can cross its cell, as bits.
  void visit(uint32_t depth, Int4 low, int32_t edge, uint64_t offset, uint64_t rays) {
    const Node n = node(depth, offset);
    const int32_t half = edge / 2;
    uint32_t candidates = mirrored_[n.mask] & cross_any(low, half);
    const bool only = (candidates & (candidates - 1)) == 0;
    // Children that get all rays without a test per ray: the only candidate, or the children that
    // all rays cross.
    const uint32_t by_all = only ? candidates : cross_all(low, half);
    Child children[8];
    int count = 0;
    for (; candidates != 0; candidates &= candidates - 1) {
      const int index = first_of(candidates);
      Child& child = children[count];
      child.low = corner(low, index, half);
      child.rays = by_all >> index & 1 ? rays : crossing(child.low, half, rays);
      if (child.rays == 0) continue;
      child.offset = n.child(index ^ job_.mirror);
      prefetch(depth + 1, child.offset);
      ++count;
    }
    const bool last = depth + 2 == job_.leaf_depth || depth + 1 == brick_depth_;
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

  // Adds a cell to the separate descent of each of `rays`. A ray without a descent begins its
  // descent in this cell; for a ray with a descent, the cell waits. The caller must push the cells
  // in the order in which a ray crosses them.
  void push(uint32_t depth, Int4 low, uint64_t offset, uint64_t rays) {
    for (; rays != 0; rays &= rays - 1) {
      const int ray = first_of(rays);
      RayDescent& descent = job_.descents[ray];
      const WaitingCell cell{low, offset, depth, -1};
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
    descent.low = cell.low;
    descent.offset = cell.offset;
    descent.depth = cell.depth;
    descent.open = 0;
    descent.first_waiting = cell.next;
  }

  // Advances all separate rays in turn, one step each, until each ray has ended or has no more
  // waiting cells.
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

  // Advances a ray into the cell that its descent enters next. Returns true if the ray continues;
  // its descent then refers to the next cell. Returns false if the ray has a hit, was given up, or
  // has no more cells.
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

  // Enters a child of `n`, the path's node at `depth`. `in` is the mask of the children to visit.
  // The ray enters the first of them; descent.left stores the others for later.
  VOXDAG_INLINE void enter_first(RayDescent& descent, uint32_t depth, uint32_t in, const Node& n) {
    const int index = first_of(in);
    descent.low = corner(descent.low, index, int32_t{1} << (job_.grid_levels - depth - 1));
    descent.offset = n.child(index ^ job_.mirror);
    descent.depth = depth + 1;
    const uint32_t left = in & (in - 1);
    descent.left[depth] = static_cast<uint8_t>(left);
    descent.open |= (left != 0 ? 1u : 0u) << depth;
    descent.children[depth] = n.children;
    prefetch(depth + 1, descent.offset);
  }

  // Moves a descent from a cell without a hit to its next cell. Returns false if there is no next
  // cell.
  VOXDAG_INLINE bool enter_next(RayDescent& descent) {
    if (descent.open == 0) {
      if (descent.first_waiting < 0) return false;
      begin(descent, job_.waiting[descent.first_waiting]);
      return true;
    }
    const uint32_t depth = 31u - static_cast<uint32_t>(__builtin_clz(descent.open));
    descent.open ^= 1u << depth;
    descent.low &= all(-(int32_t{1} << (job_.grid_levels - depth)));
    const uint32_t* const children = descent.children[depth];
    enter_first(descent, depth, descent.left[depth],
                {children[-1], children, job_.levels[depth].wide_children});
    return true;
  }

  // Casts the ray in a brick. Returns true if the ray ends in the brick, with a hit or because it
  // was given up.
  VOXDAG_INLINE bool cast_in_brick(const RayDescent& cell, int ray) {
    const uint64_t mask = brick(cell.offset);
    const uint32_t occupied = mirrored_[octants(mask)];
    if (job_.leaf_depth == brick_depth_ + 1)
      return cast_in(cell.low, 2, ray, occupied, job_.leaf_depth);
    const Crossed crossed = cross_one(cell.low, ray, 2);
    if (crossed.touching & occupied) return give_up(ray);
    for (uint32_t in = crossed.inside & occupied; in != 0; in &= in - 1) {
      const int index = first_of(in);
      if (cast_in(corner(cell.low, index, 2), 1, ray,
                  mirrored_[mask >> 8 * (index ^ job_.mirror) & 255], job_.grid_levels))
        return true;
    }
    return false;
  }

  // Casts the ray in a cell whose children all count as solid. `occupied` is the mask of the
  // existing children, `half` their edge and `depth` their depth. Returns true if the ray ends in
  // the cell, with a hit or because it was given up.
  VOXDAG_INLINE bool cast_in(Int4 low, int32_t half, int ray, uint32_t occupied, uint32_t depth) {
    const Crossed crossed = cross_one(low, ray, half);
    if (crossed.touching & occupied) return give_up(ray);
    const uint32_t in = crossed.inside & occupied;
    if (in == 0) return false;
    return report(corner(low, first_of(in), half), half, ray, depth);
  }

  // Removes the ray from the walk. RayPacket casts it with RayCaster later. Returns true.
  bool give_up(int ray) {
    job_.single |= uint64_t{1} << ray;
    return true;
  }

  // Reports this cell as the ray's hit. If the ray enters the cell through two faces at the same
  // parameter, gives the ray up instead, unless the caller needs no hits. Returns true.
  VOXDAG_INLINE bool report(Int4 low, int32_t edge, int ray, uint32_t depth) {
    if (!job_.hits) {
      job_.found |= uint64_t{1} << ray;
      return true;
    }
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
  // The rays that descend separately: as bits in under_way_, and as the first count_ elements of
  // list_. waiting_ is the number of cells that wait for these rays.
  uint64_t under_way_ = 0;
  uint8_t list_[kPacketRays];
  int count_ = 0, waiting_ = 0;
  alignas(64) double low_origin_[4], high_origin_[4], low_inverse_[4], high_inverse_[4];
};

}  // namespace
}  // namespace voxdag::query
