#include "core/backend/cpu/tile_reducer.h"

#include "core/backend/cpu/child_mask.h"
#include "core/dag/node_hash.h"

namespace voxdag::cpu {
namespace {

uint64_t hash_of(uint32_t mask, int count, const uint64_t* child_hashes) {
  uint64_t hash = node_hash_begin(mask);
  for (int i = 0; i < count; ++i) hash = node_hash_add(hash, child_hashes[i]);
  return node_hash_end(hash);
}

}  // namespace

NodeRef TileReducer::reduce_bricks(TileBricks& tile, int size_log2) {
  const int words = words_of(size_log2 - kBrickLevels);
  BrickTable& table = tables_.bricks();
  table.reserve(kTileBricks);
  const BrickCount found = kernels_.collect(tile, words, existing_, masks_);
  if (found.bricks == 0) return {};
  for (int i = 0; i < found.bricks; ++i) {
    hashes_[i] = hash_brick(masks_[i]);
    table.prefetch(hashes_[i]);
  }
  for (int i = 0; i < found.bricks; ++i) ids_[i] = table.find_or_add(masks_[i], hashes_[i]);
  tables_.counts() += {static_cast<uint64_t>(found.bricks), found.voxels};
  return reduce(words, found.bricks, kBrickLevels, size_log2);
}

NodeRef TileReducer::reduce(int words, int count, int from_log2, int size_log2) {
  for (int s = from_log2 + 1; s <= size_log2; ++s) {
    count = reduce_level(words, tables_.nodes(s));
    tables_.counts().nodes += static_cast<uint64_t>(count);
    words = (words + 7) / 8;
  }
  if (count == 0) return {};
  return {hashes_[0], ids_[0], true};
}

int TileReducer::reduce_level(int words, NodeTable& table) {
  int count = 0, children = 0;
  for (int w = 0; w < words; ++w) {
    uint64_t above = 0;
    for (uint64_t rest = existing_[w]; rest != 0;) {
      const int byte = lowest_bit(rest) / 8;
      const uint32_t mask = rest >> 8 * byte & 0xff;
      rest &= ~(uint64_t{0xff} << 8 * byte);
      above |= uint64_t{1} << byte;
      child_masks_[count] = static_cast<uint8_t>(mask);
      first_child_[count++] = static_cast<uint16_t>(children);
      children += child_count_of(mask);
    }
    // Word w / 8 of the next level was read already.
    existing_[w / 8] = w % 8 == 0 ? above : existing_[w / 8] | above << 8 * (w % 8);
  }
  table.reserve(static_cast<uint64_t>(count));
  for (int i = 0; i < count; ++i) {
    hashes_[i] =
        hash_of(child_masks_[i], child_count_of(child_masks_[i]), &hashes_[first_child_[i]]);
    table.prefetch_slot(hashes_[i]);
  }
  if (count > 4)
    for (int i = 0; i < count; ++i) table.prefetch_record(hashes_[i]);
  // A node's children stand at or behind its own place.
  for (int i = 0; i < count; ++i)
    ids_[i] = table.find_or_add(hashes_[i], child_masks_[i], &ids_[first_child_[i]],
                                child_count_of(child_masks_[i]));
  return count;
}

}  // namespace voxdag::cpu
