#include "core/format/artifact/row_order.h"

#include <algorithm>
#include <cstring>

#include "core/base/host_device.h"
#include "core/base/popcount8.h"
#include "core/dag/node_hash.h"
#include "core/format/artifact/frame_codec.h"

namespace voxdag {
namespace {

// Returns the number of children in all masks. Sets `any_empty` if a mask is 0. Processes eight
// masks per step.
uint64_t children_of(std::span<const uint8_t> masks, bool& any_empty) {
  constexpr uint64_t kOnes = 0x0101010101010101, kTops = 0x8080808080808080;
  uint64_t children = 0, empty = 0;
  for (; masks.size() >= 8; masks = masks.subspan(8)) {
    uint64_t eight;
    std::memcpy(&eight, masks.data(), 8);
    children += static_cast<uint64_t>(popcount64(eight));
    empty |= (eight - kOnes) & ~eight & kTops;  // not 0 iff a byte is 0
  }
  for (const uint8_t mask : masks) {
    children += kPopcount8[mask];
    empty |= mask == 0;
  }
  any_empty = empty != 0;
  return children;
}

bool strictly_increase(std::span<const uint64_t> values) {
  uint64_t not_greater = 0;
  for (size_t i = 1; i < values.size(); ++i) not_greater |= values[i] <= values[i - 1];
  return not_greater == 0;
}

const char* check_counts(const NodeLevelView& rows, uint64_t child_rows, uint32_t hash_bits) {
  bool any_empty = false;
  const uint64_t children = children_of(rows.masks, any_empty);
  if (any_empty) return "a child mask is 0";
  if (children != rows.children.size())
    return "the number of children differs from the bits in the child masks";
  uint32_t highest = 0;
  for (const uint32_t child : rows.children) highest = std::max(highest, child);
  if (highest >= child_rows) return "a child index is beyond the next level";
  uint64_t all_hashes = 0;
  for (const uint64_t hash : rows.hashes) all_hashes |= hash;
  if (truncate_hash(all_hashes, hash_bits) != all_hashes)
    return "a hash has bits beyond the hash bits";
  return nullptr;
}

bool are_in_total_order(const NodeLevelView& rows, const LastRow& last) {
  const uint32_t* previous = last.children;
  const uint32_t* children = rows.children.data();
  uint64_t hash = last.hash;
  uint32_t mask = static_cast<uint32_t>(last.mask);
  for (size_t i = 0; i < rows.masks.size(); ++i) {
    if (rows.hashes[i] <= hash && (i > 0 || last.present) &&
        compare_nodes(hash, mask, previous, rows.hashes[i], rows.masks[i], children) >= 0)
      return false;
    hash = rows.hashes[i];
    mask = rows.masks[i];
    previous = children;
    children += kPopcount8[mask];
  }
  return true;
}

}  // namespace

const char* check_brick_order(std::span<const uint64_t> hashes, std::span<const uint64_t> masks,
                              LastRow& last) {
  for (size_t i = 0; i < masks.size(); ++i) {
    if (masks[i] == 0) return "a brick is empty";
    if (last.present &&
        (hashes[i] < last.hash || (hashes[i] == last.hash && masks[i] <= last.mask)))
      return "bricks are not in the order of hash and mask";
    last.present = true;
    last.hash = hashes[i];
    last.mask = masks[i];
  }
  return nullptr;
}

const char* check_node_order(const NodeLevelView& rows, uint64_t child_rows, uint32_t hash_bits,
                             LastRow& last) {
  if (rows.masks.size() != rows.hashes.size()) return "the numbers of masks and hashes differ";
  if (const char* wrong = check_counts(rows, child_rows, hash_bits)) return wrong;
  if (rows.masks.empty()) return nullptr;
  // Usually the hashes strictly increase, so masks and children need not be compared.
  const bool by_hash =
      (!last.present || last.hash < rows.hashes.front()) && strictly_increase(rows.hashes);
  if (!by_hash && !are_in_total_order(rows, last)) return "nodes are not in the total order";
  std::copy(rows.children.end() - kPopcount8[rows.masks.back()], rows.children.end(),
            last.children);
  last.present = true;
  last.hash = rows.hashes.back();
  last.mask = rows.masks.back();
  return nullptr;
}

}  // namespace voxdag
