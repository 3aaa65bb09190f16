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

// Packs all inputs of small_node() into a key. Its lowest 58 bits are 24 bits for the normal, 1 for
// `fractional`, 5 for the size and 28 for f. The next bit is always 1, so that no key is 0.
uint64_t small_key(const Plane& plane, int64_t f, int size_log2) {
  uint64_t key = 1;
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
  int64_t f;
  if (const auto plane = entry.wide() ? axis_aligned_plane(triangles.wide(entry), rule_)
                                      : axis_aligned_plane(triangles.narrow(entry), rule_)) {
    if (plane->offset_from(cube, size_log2, f)) node_out = small_node(*plane, f, size_log2);
    return true;
  }
  const int tiles_log2 = 2 * (size_log2 - kTileLog2);
  const KnownPlane* known = find(triangles, entry, tiles_log2 < 0 ? 0 : uint64_t{1} << tiles_log2);
  if (known == nullptr || !known->plane.fits(size_log2)) return false;
  const Plane plane = known->plane;
  PlaneDirection* const direction = known->direction;
  if (!plane.offset_from(cube, size_log2, f)) return true;
  node_out = direction == nullptr ? small_node(plane, f, size_log2)
                                  : node(plane, *direction, f, size_log2);
  return true;
}

bool PlaneMemo::has_plane(const TriangleSet& triangles, Entry entry) {
  if (entry.wide()) return axis_aligned_plane(triangles.wide(entry), rule_).has_value();
  return axis_aligned_plane(triangles.narrow(entry), rule_).has_value() ||
         find(triangles, entry, 0) != nullptr;
}

const PlaneMemo::KnownPlane* PlaneMemo::find(const TriangleSet& triangles, Entry entry,
                                             uint64_t tiles) {
  if (entry.wide()) return nullptr;
  if (known_.size() == 0) {
    if (!fits_budget(triangles.narrow_count() * sizeof(uint32_t))) return nullptr;
    known_ = PooledArray<uint32_t>(memory_, triangles.narrow_count(), PooledArray<uint32_t>::kZero);
  }
  uint32_t& known = known_[entry.number()];
  if (known < kWorthwhile) {
    if (known + tiles < kWorthwhile) {
      known += static_cast<uint32_t>(tiles);
      return nullptr;
    }
    known = add_plane(plane_of(triangles.narrow(entry), rule_));
  }
  return known == kNever ? nullptr : &planes_[known - kWorthwhile];
}

uint32_t PlaneMemo::add_plane(const Plane& plane) {
  PlaneDirection* direction = nullptr;
  if (plane.rising() - plane.falling() > kSmallNormal) {
    direction = plane.fractional ? direction_of(plane) : nullptr;
    if (direction == nullptr) return kNever;
  }
  if (plane_count_ == kMaxPlanes) return kNever;
  if (plane_count_ == planes_.size()) {
    if (!fits_budget((plane_count_ + 256) * sizeof(KnownPlane))) return kNever;
    planes_.grow(memory_, plane_count_ + 256);
  }
  planes_[plane_count_] = {plane, direction};
  return kWorthwhile + plane_count_++;
}

PlaneDirection* PlaneMemo::direction_of(const Plane& plane) {
  for (PooledArray<PlaneDirection>& direction : directions_)
    if (direction[0].is_direction_of(plane)) return direction.data();
  if (!fits_budget((directions_.size() + 1) * sizeof(PlaneDirection))) return nullptr;
  directions_.emplace_back(memory_, 1);
  directions_.back()[0].set_up(plane);
  return directions_.back().data();
}

bool PlaneMemo::fits_budget(uint64_t bytes) const {
  return bytes <=
         BackendMemory::plane_table_bytes(memory_.budget.limit(), memory_.budget.available());
}

NodeRef PlaneMemo::node(const Plane& plane, PlaneDirection& direction, int64_t f, int size_log2) {
  if (size_log2 <= kTileLog2) return tile_node(direction, f, size_log2);
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

NodeRef PlaneMemo::tile_node(PlaneDirection& direction, int64_t f, int size_log2) {
  constexpr int kLog2 = PlaneDirection::kSizeLog2;
  // `f` is the plane's offset (plane.h) from the tile's low corner. From the low corner of the
  // tile's m-th node, the offset is f + 8 * offsets[m].
  const int64_t* offsets = direction.offsets();
  const int64_t low = direction.min_offset() - f, high = direction.max_offset() - f;
  uint64_t crossed[8];
  kernels_.find_in_range(offsets, 1 << 3 * (size_log2 - kLog2), (low + (1 << kLog2) - 1) >> kLog2,
                         high >> kLog2, crossed);
  OctreeCounts counts;
  const NodeRef found =
      reducer_.reduce_nodes(crossed, kLog2, size_log2, [&](int m) -> const PlaneDirection::Known& {
        const int64_t at_node = f + offsets[m] * (1 << kLog2);
        const PlaneDirection::Known& known = direction.node(at_node, tables_, kernels_);
        counts += {known.nodes, known.voxels};
        return known;
      });
  tables_.counts() += counts;
  return found;
}

NodeRef PlaneMemo::small_node(const Plane& plane, int64_t f, int size_log2) {
  if (!plane.crosses(f, size_log2)) return {};
  if (size_log2 == kBrickLevels) return tables_.add_brick(plane_brick(plane, f));
  reserve_small_nodes();
  const uint64_t key = small_key(plane, f, size_log2);
  if (const SmallNode& known = small_slot(key); known.key == key) {
    tables_.counts() += known.counts;
    return {known.hash, known.id, true};
  }
  const OctreeCounts before = tables_.counts();
  const NodeRef made = make_small_node(plane, f, size_log2);
  small_slot(key) = {key, made.hash, tables_.counts() - before, made.id};
  ++small_count_;
  return made;
}

NodeRef PlaneMemo::make_small_node(const Plane& plane, int64_t f, int size_log2) {
  NodeRef children[8];
  const int64_t half = int64_t{1} << (size_log2 - 1);
  for (int c = 0; c < 8; ++c) {
    int64_t at_child = f;
    for (int a = 0; a < 3; ++a) at_child += child_coordinate(c, a) * half * plane.n[a];
    children[c] = small_node(plane, at_child, size_log2 - 1);
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

// Returns the slot of a key, or the free slot for it.
PlaneMemo::SmallNode& PlaneMemo::small_slot(uint64_t key) {
  uint64_t at = key * 0x9e3779b97f4a7c15ull >> 20;
  while (true) {
    SmallNode& slot = small_nodes_[at & (small_slots_ - 1)];
    if (slot.key == key || slot.key == 0) return slot;
    ++at;
  }
}

}  // namespace voxdag::cpu
