#include "core/backend/cpu/memo/plane_memo.h"

#include <algorithm>
#include <utility>

#include "core/backend/backend_memory.h"

namespace voxdag::cpu {
namespace {

constexpr int64_t kSmallNormal = 64;       // max sum of |n_a| of a small normal
constexpr uint64_t kMinPlaneSlots = 1024;  // a power of two
// Upper bound of the number of slots that are filled between two calls of reserve_small_nodes().
constexpr uint64_t kSpareSlots = 64;
constexpr uint32_t kMaxPlanes = 1 << 20;

// Packs all inputs of small_node() into a key. The lowest 60 bits of the key are 2 bits for the
// inner sides, 24 for the normal, 1 for `fractional`, 5 for the size and 28 for f. The next bit is
// always 1, so that no key is 0.
uint64_t small_key(const Plane& plane, InnerSides inner, int64_t f, int size_log2) {
  uint64_t key = 4 | inner.bits();
  for (const int64_t x : plane.n) key = key << 8 | static_cast<uint64_t>(x + kSmallNormal);
  key = key << 1 | (plane.fractional ? 1 : 0);
  key = key << 5 | static_cast<uint64_t>(size_log2);
  // |f| <= 64 * 2^20 (kSmallNormal times the max edge in voxels), because the plane crosses the
  // cube.
  return key << 28 | static_cast<uint64_t>(f + (1 << 27));
}

}  // namespace

bool PlaneMemo::build(const TriangleSet& triangles, Entry entry, const LatticeCube& cube,
                      int size_log2, NodeRef& node_out) {
  node_out = {};
  const auto found = find_plane(triangles, entry, size_log2);
  if (!found) return false;
  int64_t f;
  if (!found->plane.offset_from(cube, size_log2, f)) return true;
  if (!found->known || planes_[*found->known].is_small) {
    node_out = small_node(found->plane, {}, f, size_log2);
    return true;
  }
  PlaneDirection* const direction = direction_of(planes_[*found->known], {});
  if (direction == nullptr) return false;
  node_out = node(found->plane, *direction, f, size_log2);
  return true;
}

std::optional<PlaneMemo::Found> PlaneMemo::find_plane(const TriangleSet& triangles, Entry entry,
                                                      int size_log2) {
  if (const auto plane = entry.wide() ? axis_aligned_plane(triangles.wide(entry), rule_)
                                      : axis_aligned_plane(triangles.narrow(entry), rule_))
    return Found{*plane, {}};
  const int tiles_log2 = 2 * (size_log2 - kTileLog2);
  const auto known = find(triangles, entry, tiles_log2 < 0 ? 0 : uint64_t{1} << tiles_log2);
  if (!known || !planes_[*known].plane.fits(size_log2)) return {};
  return Found{planes_[*known].plane, known};
}

bool PlaneMemo::build_tile(const Found& found, InnerSides inner, int64_t f, int size_log2,
                           NodeRef& node_out, uint64_t& filled) {
  const uint64_t before = filled_;
  if (!found.known || planes_[*found.known].is_small) {
    node_out = small_node(found.plane, inner, f, size_log2);
  } else {
    PlaneDirection* const direction = direction_of(planes_[*found.known], inner);
    if (direction == nullptr) return false;
    node_out = tile_node(*direction, inner, f, size_log2);
  }
  filled = filled_ - before;
  return true;
}

bool PlaneMemo::has_plane(const TriangleSet& triangles, Entry entry) {
  if (entry.wide()) return axis_aligned_plane(triangles.wide(entry), rule_).has_value();
  return axis_aligned_plane(triangles.narrow(entry), rule_).has_value() ||
         find(triangles, entry, 0).has_value();
}

std::optional<uint32_t> PlaneMemo::find(const TriangleSet& triangles, Entry entry, uint64_t tiles) {
  if (entry.wide()) return {};
  if (known_.size() == 0) {
    if (!fits_budget(triangles.narrow_count() * sizeof(uint32_t))) return {};
    known_ = PooledArray<uint32_t>(memory_, triangles.narrow_count(), PooledArray<uint32_t>::kZero);
  }
  uint32_t& known = known_[entry.number()];
  if (known < kWorthwhile) {
    if (known + tiles < kWorthwhile) {
      known += static_cast<uint32_t>(tiles);
      return {};
    }
    known = add_plane(plane_of(triangles.narrow(entry), rule_));
  }
  if (known == kNever) return {};
  return known - kWorthwhile;
}

uint32_t PlaneMemo::add_plane(const Plane& plane) {
  const bool is_small = plane.rising() - plane.falling() <= kSmallNormal;
  if (!is_small && !plane.fractional) return kNever;
  if (plane_count_ == kMaxPlanes) return kNever;
  if (plane_count_ == planes_.size()) {
    if (!fits_budget((plane_count_ + 256) * sizeof(KnownPlane))) return kNever;
    planes_.grow(memory_, plane_count_ + 256);
  }
  planes_[plane_count_] = {plane, is_small, {}};
  return kWorthwhile + plane_count_++;
}

PlaneDirection* PlaneMemo::direction_of(KnownPlane& known, InnerSides inner) {
  PlaneDirection*& direction = known.directions[inner.bits()];
  if (direction == nullptr) direction = find_direction(known.plane, inner);
  return direction;
}

PlaneDirection* PlaneMemo::find_direction(const Plane& plane, InnerSides inner) {
  for (PooledArray<PlaneDirection>& direction : directions_)
    if (direction[0].is_direction_of(plane, inner)) return direction.data();
  if (!fits_budget((directions_.size() + 1) * sizeof(PlaneDirection))) return nullptr;
  directions_.emplace_back(memory_, 1);
  directions_.back()[0].set_up(plane, inner);
  return directions_.back().data();
}

bool PlaneMemo::fits_budget(uint64_t bytes) const {
  return bytes <=
         BackendMemory::plane_table_bytes(memory_.budget.limit(), memory_.budget.available());
}

NodeRef PlaneMemo::node(const Plane& plane, PlaneDirection& direction, int64_t f, int size_log2) {
  if (size_log2 <= kTileLog2) return tile_node(direction, {}, f, size_log2);
  NodeRef children[8];
  const int64_t half = int64_t{1} << (size_log2 - 1);
  for (int c = 0; c < 8; ++c) {
    int64_t at_child = f;
    for (int a = 0; a < 3; ++a) at_child += child_coordinate(c, a) * half * plane.n[a];
    if (plane.crosses(at_child, size_log2 - 1))
      children[c] = node(plane, direction, at_child, size_log2 - 1);
  }
  return tables_.add_node(size_log2, children);
}

NodeRef PlaneMemo::tile_node(PlaneDirection& direction, InnerSides inner, int64_t f,
                             int size_log2) {
  if (size_log2 > LargePlaneNodes::kSizeLog2) {
    if (direction.add_tile() == kLargeWorthwhile) add_large_nodes(direction);
    if (LargePlaneNodes* const large = direction.large())
      return tile_node_of(direction, inner, f, size_log2, *large, [&](int64_t at) -> PlaneNode& {
        PlaneNode& node = large->at(at);
        if (node.nodes == 0) make_large_node(direction, inner, at, node);
        return node;
      });
  }
  return tile_node_of(
      direction, inner, f, size_log2, direction.small(),
      [&](int64_t at) -> const PlaneNode& { return direction.small_node(at, tables_, kernels_); });
}

// Returns the node of a tile with an edge of 2^size_log2 voxels, from smaller nodes. `nodes` are
// the PlaneNodes of their size. node_at(f) returns the node for a plane's offset from a cube.
template <int kLog2, class NodeAt>
NodeRef PlaneMemo::tile_node_of(const PlaneDirection& direction, InnerSides inner, int64_t f,
                                int size_log2, const PlaneNodes<kLog2>& nodes,
                                const NodeAt& node_at) {
  // `f` is the plane's offset (plane.h) from the tile's low corner. From the low corner of the
  // tile's m-th smaller cube, the offset is f + 2^kLog2 * offsets[m].
  const int64_t* offsets = direction.offsets();
  const int64_t low = nodes.min_offset() - f, high = nodes.max_offset() - f;
  const int count = 1 << 3 * (size_log2 - kLog2);
  const PlaneRange crossed{(low + (1 << kLog2) - 1) >> kLog2, high >> kLog2};
  uint64_t existing[8], touched[8];
  kernels_.find_in_range(offsets, count, crossed.low, crossed.high, touched);
  std::copy(touched, touched + 8, existing);
  OctreeCounts counts;
  if (inner.any()) add_full(offsets, count, inner, crossed, kLog2, existing, counts);
  const auto node_of = [&](int m) -> const PlaneNode& {
    return node_at(f + offsets[m] * (1 << kLog2));
  };
  // Makes the large nodes that do not exist yet. This uses the reducer, so it must be done before
  // the reducer starts with the tile.
  if constexpr (kLog2 == LargePlaneNodes::kSizeLog2)
    for (uint64_t rest = touched[0]; rest != 0; rest &= rest - 1) node_of(lowest_bit(rest));
  struct Node {
    uint64_t hash;
    uint32_t id;
  };
  const auto next = [&](int m) -> Node {
    if ((touched[m / 64] >> m % 64 & 1) == 0) return {full_.node(kLog2).hash, full_.node(kLog2).id};
    const PlaneNode& node = node_of(m);
    counts += {node.nodes, node.voxels};
    filled_ += node.filled;
    return {node.hash, node.id};
  };
  const NodeRef found = reducer_.reduce_nodes(existing, kLog2, size_log2, next);
  tables_.counts() += counts;
  return found;
}

void PlaneMemo::add_large_nodes(PlaneDirection& direction) {
  if (!fits_budget((large_nodes_.size() + 1) * sizeof(LargePlaneNodes))) return;
  LargePlaneNodes& large = *large_nodes_.emplace_back(memory_, 1).data();
  large.set_up(direction.plane());
  direction.set_large(&large);
}

void PlaneMemo::make_large_node(PlaneDirection& direction, InnerSides inner, int64_t f,
                                PlaneNode& node) {
  const OctreeCounts before = tables_.counts();
  const uint64_t filled_before = filled_;
  const NodeRef made = tile_node(direction, inner, f, LargePlaneNodes::kSizeLog2);
  node = PlaneNode(made, tables_.counts() - before, filled_ - filled_before);
  tables_.counts() = before;
  filled_ = filled_before;
}

void PlaneMemo::add_full(const int64_t* offsets, int count, InnerSides inner,
                         const PlaneRange& crossed, int from_log2, uint64_t (&existing)[8],
                         OctreeCounts& counts) {
  const PlaneRange all = crossed.with(inner);
  uint64_t touched = 0, set = 0;
  for (int w = 0; w < (count + 63) / 64; ++w)
    touched += static_cast<uint64_t>(popcount64(existing[w]));
  kernels_.find_in_range(offsets, count, all.low, all.high, existing);
  for (int w = 0; w < (count + 63) / 64; ++w) set += static_cast<uint64_t>(popcount64(existing[w]));
  const OctreeCounts full = full_counts(from_log2);
  counts += {(set - touched) * full.nodes, (set - touched) * full.voxels};
  filled_ += (set - touched) * full.voxels;
}

NodeRef PlaneMemo::full_node(int size_log2) {
  const OctreeCounts counts = full_counts(size_log2);
  tables_.counts() += counts;
  filled_ += counts.voxels;
  return full_.node(size_log2);
}

NodeRef PlaneMemo::small_node(const Plane& plane, InnerSides inner, int64_t f, int size_log2) {
  if (!plane.crosses(f, size_log2)) {
    const bool is_inner = plane.is_below(f, size_log2) ? inner.above : inner.below;
    return is_inner ? full_node(size_log2) : NodeRef{};
  }
  if (size_log2 == kBrickLevels) {
    const uint64_t shell = plane_brick(plane, f), brick = plane_brick(plane, f, inner);
    filled_ += static_cast<uint64_t>(popcount64(brick & ~shell));
    return tables_.add_brick(brick);
  }
  reserve_small_nodes();
  const uint64_t key = small_key(plane, inner, f, size_log2);
  if (const SmallNode& known = small_slot(key); known.key == key) {
    tables_.counts() += known.counts;
    filled_ += known.filled;
    return {known.hash, known.id, true};
  }
  const OctreeCounts before = tables_.counts();
  const uint64_t filled_before = filled_;
  const NodeRef made = make_small_node(plane, inner, f, size_log2);
  small_slot(key) = {key, made.hash, tables_.counts() - before, filled_ - filled_before, made.id};
  ++small_count_;
  return made;
}

NodeRef PlaneMemo::make_small_node(const Plane& plane, InnerSides inner, int64_t f, int size_log2) {
  NodeRef children[8];
  const int64_t half = int64_t{1} << (size_log2 - 1);
  for (int c = 0; c < 8; ++c) {
    int64_t at_child = f;
    for (int a = 0; a < 3; ++a) at_child += child_coordinate(c, a) * half * plane.n[a];
    children[c] = small_node(plane, inner, at_child, size_log2 - 1);
  }
  return tables_.add_node(size_log2, children);
}

void PlaneMemo::reserve_small_nodes() {
  if ((small_count_ + kSpareSlots) * 2 <= small_slots_) return;
  const uint64_t slots = small_slots_ == 0 ? kMinPlaneSlots : 2 * small_slots_;
  if (small_slots_ != 0 && !fits_budget(slots * sizeof(SmallNode))) {
    std::fill(small_nodes_.begin(), small_nodes_.end(), SmallNode{});
    small_count_ = 0;
    return;
  }
  const PooledArray<SmallNode> old = std::move(small_nodes_);
  const uint64_t old_slots = std::exchange(small_slots_, slots);
  small_nodes_ = PooledArray<SmallNode>(memory_, slots, PooledArray<SmallNode>::kZero);
  for (uint64_t i = 0; i < old_slots; ++i)
    if (old[i].key != 0) small_slot(old[i].key) = old[i];
}

// Returns the slot that contains the key or, if no slot contains it, the free slot for this key.
PlaneMemo::SmallNode& PlaneMemo::small_slot(uint64_t key) {
  uint64_t at = key * 0x9e3779b97f4a7c15ull >> 20;
  while (true) {
    SmallNode& slot = small_nodes_[at & (small_slots_ - 1)];
    if (slot.key == key || slot.key == 0) return slot;
    ++at;
  }
}

}  // namespace voxdag::cpu
