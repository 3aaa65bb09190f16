#include "core/backend/cpu/memo/tile_reducer.h"

#include <bit>
#include <utility>

#include "core/dag/node_hash.h"

namespace voxdag::cpu {

NodeRef TileReducer::reduce_bricks(TileBricks& tile, int size_log2, const uint64_t* full) {
  if (size_log2 == kBrickLevels) {
    tile.touched[0] = 0;
    return tables_.add_brick(std::exchange(tile.brick(0), 0));
  }
  const int words = words_of(size_log2 - kBlockLog2);
  int count = kernels_.list_blocks(tile, 8 * words, existing_.bytes, blocks_, keys_);
  if (count > 0) find_blocks(tile, count);
  tables_.counts().nodes += static_cast<uint64_t>(count);
  if (full != nullptr) count = add_full_blocks(full, words, count);
  return reduce(words, count, kBlockLog2, size_log2);
}

void TileReducer::find_blocks(TileBricks& tile, int count) {
  int missed = 0;
  const bool use_memo = memo_.is_worthwhile(count);
  if (!use_memo) {
    for (; missed < count; ++missed) new_blocks_[missed] = static_cast<uint16_t>(missed);
  } else {
    for (int i = 0; i < count; ++i) memo_.prefetch(keys_[i]);
    OctreeCounts counts;
    for (int i = 0; i < count; ++i) {
      VoxelBlock& block = tile.blocks[blocks_[i]];
      if (const BlockMemo::Node* node = memo_.find(keys_[i], block)) {
        ids_[i] = node->id;
        hashes_[i] = node->hash;
        counts += {node->bricks, node->voxels};
        block = {};
      } else {
        new_blocks_[missed++] = static_cast<uint16_t>(i);
      }
    }
    tables_.counts() += counts;
  }
  if (missed > 0) find_new_blocks(tile, missed, use_memo);
}

void TileReducer::find_new_blocks(TileBricks& tile, int count, bool insert) {
  parents_.count = parents_.children = 0;
  for (int i = 0; i < count; ++i) {
    const VoxelBlockContent content =
        kernels_.unpack(tile.blocks[blocks_[new_blocks_[i]]], bricks_ + parents_.children);
    parents_.add(content.mask);
    new_voxels_[i] = static_cast<uint16_t>(content.voxels);
  }
  BrickTable& table = tables_.bricks();
  const int bricks = parents_.children;
  table.reserve(static_cast<uint64_t>(bricks));
  for (int i = 0; i < bricks; ++i) {
    brick_hashes_[i] = hash_brick(bricks_[i]);
    table.prefetch(brick_hashes_[i]);
  }
  for (int i = 0; i < bricks; ++i) brick_ids_[i] = table.find_or_add(bricks_[i], brick_hashes_[i]);
  look_up(parents_, tables_.nodes(kBlockLog2), brick_hashes_, brick_ids_);
  for (int i = 0; i < count; ++i) {
    const int at = new_blocks_[i];
    ids_[at] = brick_ids_[i];
    hashes_[at] = brick_hashes_[i];
    const BlockMemo::Node node{hashes_[at], ids_[at], new_voxels_[i],
                               static_cast<uint16_t>(popcount8(parents_.masks[i]))};
    tables_.counts() += {node.bricks, node.voxels};
    VoxelBlock& block = tile.blocks[blocks_[at]];
    if (insert) memo_.insert(keys_[at], block, node);
    block = {};
  }
}

int TileReducer::add_full_blocks(const uint64_t* full, int words, int count) {
  int added = 0;
  for (int w = 0; w < words; ++w) added += popcount64(full[w]);
  if (added == 0) return count;
  const NodeRef& node = full_.node(kBlockLog2);
  const OctreeCounts counts = full_counts(kBlockLog2);
  const auto times = static_cast<uint64_t>(added);
  tables_.counts() += {times * counts.nodes, times * counts.voxels};
  const int total = count + added;
  // Goes from the last node to the first, because nodes move to higher positions in the same
  // arrays.
  for (int w = words, to = total; w-- > 0;) {
    existing_.words[w] |= full[w];
    for (uint64_t rest = existing_.words[w]; rest != 0;) {
      const int bit = 63 - std::countl_zero(rest);
      rest ^= uint64_t{1} << bit;
      const bool is_full = full[w] >> bit & 1;
      --to;
      if (!is_full) --count;
      ids_[to] = is_full ? node.id : ids_[count];
      hashes_[to] = is_full ? node.hash : hashes_[count];
    }
  }
  return total;
}

NodeRef TileReducer::reduce(int words, int count, int from_log2, int size_log2) {
  if (count == 0) return {};
  for (int s = from_log2 + 1; s <= size_log2; ++s) {
    parents_.count = parents_.children = 0;
    for (int w = 0; w < words; ++w) {
      uint64_t above = 0;
      for (uint64_t rest = existing_.words[w]; rest != 0;) {
        const int byte = lowest_bit(rest) / 8;
        parents_.add(rest >> 8 * byte & 0xff);
        rest &= ~(uint64_t{0xff} << 8 * byte);
        above |= uint64_t{1} << byte;
      }
      // Overwrites word w / 8 with bits of the next coarser level. The old bits of this word have
      // already been processed, because w / 8 <= w.
      existing_.words[w / 8] = w % 8 == 0 ? above : existing_.words[w / 8] | above << 8 * (w % 8);
    }
    look_up(parents_, tables_.nodes(s), hashes_, ids_);
    tables_.counts().nodes += static_cast<uint64_t>(parents_.count);
    words = (words + 7) / 8;
  }
  return {hashes_[0], ids_[0], true};
}

void TileReducer::look_up(const Parents& parents, NodeTable& table, uint64_t* hashes,
                          uint32_t* ids) {
  const int count = parents.count;
  table.reserve(static_cast<uint64_t>(count));
  // In `hashes` and `ids`, the values of a node's children are at or after the node's position, so
  // they are read before they are overwritten.
  for (int i = 0; i < count; ++i) {
    hashes[i] =
        hash_node(parents.masks[i], popcount8(parents.masks[i]), &hashes[parents.first_child[i]]);
    table.prefetch_slot(hashes[i]);
  }
  if (count > 4)
    for (int i = 0; i < count; ++i) table.prefetch_record(hashes[i]);
  for (int i = 0; i < count; ++i)
    ids[i] = table.find_or_add(hashes[i], parents.masks[i], &ids[parents.first_child[i]],
                               popcount8(parents.masks[i]));
}

}  // namespace voxdag::cpu
