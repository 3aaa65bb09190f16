// Computes the subtree values (subtree_table.h) of a batch of nodes from the values of their
// children. The lookups of children read memory at random places. So the reads of a batch are
// prefetched, and their cache misses overlap.
#pragma once

#include <cstdint>

#include "core/base/popcount8.h"
#include "core/dag/node_hash.h"
#include "core/format/global/node_index.h"
#include "core/format/global/voxdag_reader.h"
#include "core/format/verify/subtree_table.h"

namespace voxdag {

// Finds the values of children in a list, in which they are grouped by windows: ranges of words of
// the child level. The pointers must be passed in the order of the values of each window.
struct ChildSlots {
  int window_shift = 0;  // a window has 2^window_shift words
  uint64_t windows = 1;
  uint64_t count = 0;        // values in the list
  uint32_t* next = nullptr;  // by window: index of the next value

  VOXDAG_INLINE uint64_t window_of(uint64_t pointer) const {
    const uint64_t window = pointer >> window_shift;
    return window < windows ? window : windows - 1;
  }
  // Returns the index of the next value, which belongs to `pointer`. If there is none, returns
  // NodeIndex::kNone; this is possible only if the level has changed.
  VOXDAG_INLINE uint64_t take(uint64_t pointer) const {
    const uint64_t slot = next[window_of(pointer)]++;
    return slot < count ? slot : NodeIndex::kNone;
  }
};

// A level above the bricks, with the index and the table of the next finer level. If `slots` is not
// null, it is used instead of `below`, and `children` has its list.
struct NodeLevel {
  voxdag_reader::Level nodes;
  uint32_t hash_bits = 64;
  bool is_wide = false;  // true if child pointers have two words
  NodeIndex::Lookup below;
  SubtreeWords children;
  const ChildSlots* slots = nullptr;
};

struct NodeBatch {
  static constexpr uint32_t kNodes = 64;

  uint32_t count = 0;
  uint64_t at[kNodes];  // word offsets at which the nodes begin
  // Results. `subtrees` has results for the first `valid` nodes. `valid` is less than `count` if
  // the next node has a child pointer that leads to no node. `broken_child` is then the number of
  // this pointer (from 0).
  uint32_t valid = 0;
  int broken_child = 0;
  Subtree subtrees[kNodes];
};

// Computes the results of `batch`. All nodes must be nodes of the level. Also records that the
// children have a parent. Several threads may use the same level.
using ComputeBatch = void (*)(const NodeLevel& level, NodeBatch& batch);
void compute_batch_portable(const NodeLevel& level, NodeBatch& batch);
// Returns a version that counts bits with the instruction POPCNT, and has the same results. Returns
// null if this version was not built, or if the CPU does not have the instruction.
ComputeBatch compute_batch_popcnt();
ComputeBatch compute_batch();  // returns the fastest version

// Implements ComputeBatch. Only the files that define the versions use this class. `Version` is a
// type of that file, so each version has its own functions.
template <class Version>
class BatchComputer {
 public:
  BatchComputer(const NodeLevel& level, NodeBatch& batch) : level_(level), batch_(batch) {}

  VOXDAG_INLINE void run() {
    collect_pointers();
    if (level_.slots)
      find_slots();
    else
      find_children();
    if (level_.children.is_small)
      combine<true>();
    else
      combine<false>();
  }

 private:
  // Copies the child pointers of all nodes to one list.
  VOXDAG_INLINE void collect_pointers() {
    const bool is_wide = level_.is_wide;
    uint32_t filled = 0;
    for (uint32_t i = 0; i < batch_.count; ++i) {
      const uint64_t at = batch_.at[i];
      const uint32_t* const words = level_.nodes.words + at;
      const uint32_t mask = words[0] & 0xff;  // 1 to 255, unless the file has changed
      const uint32_t count = kPopcount8[mask];
      masks_[i] = static_cast<uint8_t>(mask);
      first_[i] = filled;
      // Copying all words that could be pointers is faster than copying `count` pointers.
      if (!is_wide && level_.nodes.word_count - at > 8)
        for (uint32_t c = 0; c < 8; ++c) pointers_[filled + c] = words[1 + c];
      else
        for (uint32_t c = 0; c < count; ++c)
          pointers_[filled + c] = voxdag_reader::Node{mask, words + 1, is_wide}.child(int(c));
      for (uint32_t c = 0; c < count; ++c) level_.below.prefetch(pointers_[filled + c]);
      filled += count;
    }
    first_[batch_.count] = filled;
  }

  // Replaces the pointers with the indexes of the children in the next finer level.
  VOXDAG_INLINE void find_children() {
    batch_.valid = batch_.count;
    for (uint32_t p = 0; p < first_[batch_.count]; ++p) {
      const uint64_t child = level_.below.find(pointers_[p]);
      if (child == NodeIndex::kNone) return stop_before(p);
      pointers_[p] = child;
      level_.children.prefetch(child);
    }
  }
  VOXDAG_INLINE void find_slots() {
    batch_.valid = batch_.count;
    for (uint32_t p = 0; p < first_[batch_.count]; ++p) {
      const uint64_t slot = level_.slots->take(pointers_[p]);
      if (slot == NodeIndex::kNone || level_.children.is_broken(slot)) return stop_before(p);
      pointers_[p] = slot;
    }
  }
  void stop_before(uint32_t pointer) {
    while (first_[batch_.valid] > pointer) --batch_.valid;
    batch_.broken_child = static_cast<int>(pointer - first_[batch_.valid]);
  }

  template <bool kIsSmall>
  VOXDAG_INLINE void combine() {
    for (uint32_t i = 0; i < batch_.valid; ++i) {
      uint64_t state = node_hash_begin(masks_[i]);
      uint64_t voxels = 0, svo_nodes = 0;
      for (uint32_t p = first_[i]; p < first_[i + 1]; ++p) {
        uint32_t* const child = level_.children.words + (kIsSmall ? 3 : 6) * pointers_[p];
        state = node_hash_add(state, SubtreeWords::word64(child));
        if constexpr (kIsSmall) {
          voxels += SubtreeWords::remove_parent_bit(child + 2, SubtreeWords::kSmallParentBit);
        } else {
          voxels += SubtreeWords::word64(child + 2);
          svo_nodes += SubtreeWords::remove_parent_bit(reinterpret_cast<uint64_t*>(child + 4),
                                                       SubtreeWords::kParentBit);
        }
      }
      if constexpr (kIsSmall) {
        svo_nodes = voxels >> SubtreeWords::kVoxelBits;
        voxels &= (uint64_t{1} << SubtreeWords::kVoxelBits) - 1;
      }
      batch_.subtrees[i] = {truncate_hash(node_hash_end(state), level_.hash_bits), voxels,
                            svo_nodes + 1};
    }
  }

  const NodeLevel& level_;
  NodeBatch& batch_;
  uint8_t masks_[NodeBatch::kNodes];
  uint32_t first_[NodeBatch::kNodes + 1];  // index of each node's first pointer in pointers_
  uint64_t pointers_[8 * NodeBatch::kNodes];
};

}  // namespace voxdag
