#include "core/format/row_order.h"

#include <algorithm>

#include "core/dag/node_hash.h"
#include "core/format/frame_codec.h"

namespace voxdag {
namespace {

const char* check_counts(const NodeLevelView& rows, uint64_t child_rows, uint32_t hash_bits) {
  uint64_t children = 0, empty = 0;
  for (const uint8_t mask : rows.masks) {
    children += kChildCount[mask];
    empty += mask == 0;
  }
  if (empty != 0) return "a child mask is 0";
  if (children != rows.children.size()) return "children and child masks disagree in number";
  uint32_t highest = 0;
  for (const uint32_t child : rows.children) highest = std::max(highest, child);
  if (highest >= child_rows) return "a child index is beyond the next level";
  uint64_t all_hashes = 0;
  for (const uint64_t hash : rows.hashes) all_hashes |= hash;
  if (cut_hash(all_hashes, hash_bits) != all_hashes) return "a hash has bits below the cut";
  return nullptr;
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
  if (rows.masks.size() != rows.hashes.size()) return "masks and hashes disagree in number";
  if (const char* wrong = check_counts(rows, child_rows, hash_bits)) return wrong;
  if (rows.masks.empty()) return nullptr;
  const uint32_t* previous = last.children;
  const uint32_t* children = rows.children.data();
  uint64_t hash = last.hash;
  uint32_t mask = static_cast<uint32_t>(last.mask);
  for (size_t i = 0; i < rows.masks.size(); ++i) {
    // Most neighbours differ in the hash already.
    if (rows.hashes[i] <= hash && (i > 0 || last.present) &&
        compare_nodes(hash, mask, previous, rows.hashes[i], rows.masks[i], children) >= 0)
      return "nodes are not in the total order";
    hash = rows.hashes[i];
    mask = rows.masks[i];
    previous = children;
    children += kChildCount[mask];
  }
  std::copy(previous, children, last.children);
  last.present = true;
  last.hash = hash;
  last.mask = mask;
  return nullptr;
}

}  // namespace voxdag
