#include "core/dag/space/face_relations.h"

#include "core/base/integers.h"
#include "core/base/memory_budget.h"

namespace voxdag {
namespace {

constexpr uint64_t kMinSlots = uint64_t{1} << 10, kMaxSlots = uint64_t{1} << 11;
constexpr uint64_t kBudgetPart = 32;  // the cache takes at most 1/kBudgetPart of the budget

constexpr uint64_t pair_bit(uint32_t low, uint32_t high) {
  return uint64_t{1} << (FaceRelations::kMaxComponents * low + high);
}

// Returns all pairs (as Meeting::pairs) of a component in `low` and a component in `high`. Both are
// sets of components, as bits.
uint64_t all_pairs(uint32_t low, uint32_t high) {
  uint64_t pairs = 0;
  for (uint32_t rest = low; rest != 0; rest &= rest - 1)
    pairs |= uint64_t{high} << FaceRelations::kMaxComponents *
                                   static_cast<uint32_t>(std::countr_zero(rest));
  return pairs;
}

}  // namespace

FaceRelations::FaceRelations(PooledMemory& memory, const SpaceLabels& labels)
    : labels_(labels), slots_(kMinSlots) {
  while (slots_ < kMaxSlots && 2 * slots_ * sizeof(Entry) * kBudgetPart <= memory.budget.limit())
    slots_ *= 2;
  cache_ = PooledArray<Entry>(memory, slots_, PooledArray<Entry>::kZero);
}

std::optional<FaceRelations::Meeting> FaceRelations::find(int depth, uint32_t low, uint32_t high,
                                                          int axis) {
  if (labels_.count(depth, low) > kMaxComponents || labels_.count(depth, high) > kMaxComponents)
    return std::nullopt;
  const uint32_t of_low = at_face(depth, low, 2 * axis + 1);
  const uint32_t of_high = at_face(depth, high, 2 * axis);
  if (of_low == 0 || of_high == 0) return Meeting{};
  if ((labels_.open_faces(depth, low) >> (2 * axis + 1) & 1) != 0 ||
      (labels_.open_faces(depth, high) >> 2 * axis & 1) != 0)
    return Meeting{all_pairs(of_low, of_high)};
  if (depth == labels_.levels().brick_depth()) return meet_bricks(low, high, axis);
  const uint32_t tag = static_cast<uint32_t>(4 * depth + axis + 1);
  const uint64_t hash = fold_multiply((uint64_t{low} << 32 | high) ^ 0x9e3779b97f4a7c15ull,
                                      tag * 0xd6e8feb86659fd93ull);
  Entry& entry = cache_[hash & (slots_ - 1)];
  if (entry.tag == tag && entry.low == low && entry.high == high) return Meeting{entry.pairs};
  const auto meeting = meet_octants(depth, low, high, axis);
  if (meeting) entry = {meeting->pairs, low, high, tag};
  return meeting;
}

uint32_t FaceRelations::at_face(int depth, uint32_t row, int face) const {
  const uint8_t* const touch = labels_.touch(depth, row);
  const uint32_t count = labels_.count(depth, row);
  uint32_t components = 0;
  for (uint32_t c = 0; c < count; ++c) components |= (touch[c] >> face & 1u) << c;
  return components;
}

FaceRelations::Meeting FaceRelations::meet_bricks(uint32_t low, uint32_t high, int axis) const {
  const int depth = labels_.levels().brick_depth();
  const uint64_t* const from = labels_.brick_components(low);
  const uint64_t* const to = labels_.brick_components(high);
  const uint32_t from_count = labels_.count(depth, low), to_count = labels_.count(depth, high);
  Meeting out;
  for (uint32_t i = 0; i < from_count; ++i) {
    const uint64_t face = (from[i] & brick_face(2 * axis + 1)) >> brick_face_shift(axis);
    for (uint32_t j = 0; j < to_count; ++j)
      if ((face & to[j]) != 0) out.pairs |= pair_bit(i, j);
  }
  return out;
}

std::optional<FaceRelations::Meeting> FaceRelations::meet_octants(int depth, uint32_t low,
                                                                  uint32_t high, int axis) {
  Meeting out;
  for (int o = 0; o < 8; ++o) {
    if ((o & 4 >> axis) != 0) continue;
    const int of_low = o | 4 >> axis;
    const auto meeting = meet_pair(depth, low, of_low, high, o, axis);
    if (!meeting) return std::nullopt;
    const uint16_t* const low_labels = labels_.labels_of_octant(depth, low, of_low);
    const uint16_t* const high_labels = labels_.labels_of_octant(depth, high, o);
    for (uint64_t rest = meeting->pairs; rest != 0; rest &= rest - 1) {
      const int pair = lowest_pair(rest);
      out.pairs |= pair_bit(low_labels[FaceRelations::of_low(pair)], high_labels[of_high(pair)]);
    }
  }
  return out;
}

std::optional<FaceRelations::Meeting> FaceRelations::meet_pair(int depth, uint32_t low, int o,
                                                               uint32_t high, int p, int axis) {
  const NodeLevels& levels = labels_.levels();
  const bool has_low = levels.has_child(depth, low, o), has_high = levels.has_child(depth, high, p);
  const uint32_t low_row = has_low ? levels.child(depth, low, o) : 0;
  const uint32_t high_row = has_high ? levels.child(depth, high, p) : 0;
  if (has_low && has_high) return find(depth + 1, low_row, high_row, axis);
  if ((has_low && labels_.count(depth + 1, low_row) > kMaxComponents) ||
      (has_high && labels_.count(depth + 1, high_row) > kMaxComponents))
    return std::nullopt;
  return Meeting{all_pairs(has_low ? at_face(depth + 1, low_row, 2 * axis + 1) : 1,
                           has_high ? at_face(depth + 1, high_row, 2 * axis) : 1)};
}

}  // namespace voxdag
