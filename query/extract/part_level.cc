#include "query/extract/part_level.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace voxdag::query {
namespace {

constexpr int kDigitBits = 11;
constexpr uint64_t kDigits = uint64_t{1} << kDigitBits;
// Lists with fewer nodes than this are sorted by std::sort instead of the radix sort.
constexpr uint64_t kFewToSort = 1 << 12;

uint64_t digit_of(const WantedNode& node, int shift) {
  return node.offset >> shift & (kDigits - 1);
}

// Sorts the nodes by one digit of their offsets and writes them to `to`: a step of a radix sort.
// The digit is the kDigitBits bits from bit `shift` up. The sort is stable.
void sort_by_digit(std::span<const WantedNode> from, WantedNode* to, int shift) {
  uint64_t next[kDigits] = {};
  for (const WantedNode& node : from) ++next[digit_of(node, shift)];
  uint64_t before = 0;
  for (uint64_t& first : next) before += std::exchange(first, before);
  for (const WantedNode& node : from) to[next[digit_of(node, shift)]++] = node;
}

}  // namespace

PartLevel::Sorted PartLevel::sort() {
  slots_ = {};
  slots_size_ = 0;
  Sorted sorted{PooledArray<WantedNode>(*memory_, count_), count_};
  uint64_t all_bits = 0;
  for (uint64_t i = 0; i < count_; ++i) {
    sorted.nodes[i] = {entries_[i].offset, i};
    all_bits |= entries_[i].offset;
  }
  if (count_ < kFewToSort) {
    std::sort(sorted.nodes.data(), sorted.nodes.data() + count_,
              [](const WantedNode& a, const WantedNode& b) { return a.offset < b.offset; });
    return sorted;
  }
  PooledArray<WantedNode> other(*memory_, count_);
  for (int shift = 0; shift < 64 - std::countl_zero(all_bits); shift += kDigitBits) {
    sort_by_digit(sorted.span(), other.data(), shift);
    std::swap(sorted.nodes, other);
  }
  return sorted;
}

void PartLevel::grow_slots(uint64_t slots_needed) {
  const uint64_t size = std::bit_ceil(std::max(slots_needed, kFirstSlots));
  PooledArray<uint64_t> slots(*memory_, size, PooledArray<uint64_t>::kZero);
  const int shift = 64 - std::countr_zero(size);
  for (uint64_t index = 0; index < count_; ++index) {
    if (is_cut(index)) continue;
    const uint64_t hash = entries_[index].offset * kMultiplier;
    uint64_t at = hash >> shift;
    while (slots[at] != 0) at = (at + 1) & (size - 1);
    slots[at] = hash << 32 | (index + 1);
  }
  slots_ = std::move(slots);
  slots_size_ = size;
  shift_ = shift;
}

}  // namespace voxdag::query
