// Values that `verify` computes for each node of a level: the truncated hash of the node's subtree,
// the numbers of voxels and octree nodes in the subtree, and whether a parent refers to the node.
//
// The values of a node are adjacent in memory, because parents read them at random places. If the
// level's cubes have at most 32 voxels per edge, a node takes three words of 32 bits:
//
//     words 0, 1            hash, low half first
//     word 2, bits 0-18     voxels, at most 2^15
//             bits 19-30    octree nodes, at most 585
//             bit 31        1 if the node has a parent
//
// The sum of eight such words without bit 31 has at most 2^18 voxels in its bits 0-18, and the
// octree nodes from bit 19 on. A node of another level takes three words of 64 bits: hash, voxels
// and octree nodes, with bit 63 instead of bit 31. Values that mean "no such node" have ones in all
// bits.
#pragma once

#include <cstdint>
#include <cstring>
#include <span>

#include "core/base/host_device.h"
#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"

namespace voxdag {

// The values of a subtree.
struct Subtree {
  uint64_t hash = 0;
  uint64_t voxels = 0;
  uint64_t svo_nodes = 0;  // octree nodes, including the subtree's root
};

// The words of a table. The functions are always inlined, because sources that are compiled for
// different instruction sets call them.
struct SubtreeWords {
  static constexpr uint32_t kMaxSmallCubeLevels = 5;
  static constexpr int kVoxelBits = 19;
  static constexpr uint32_t kSmallParentBit = uint32_t{1} << 31;
  static constexpr uint64_t kParentBit = uint64_t{1} << 63;

  uint32_t* words = nullptr;
  bool is_small = true;

  VOXDAG_INLINE uint32_t* node(uint64_t i) const { return words + (is_small ? 3 : 6) * i; }
  // Prefetches both ends of the values, because they can be in two cache lines.
  VOXDAG_PREFETCH void prefetch(uint64_t i) const {
    __builtin_prefetch(node(i));
    __builtin_prefetch(node(i + 1) - 1);
  }
  VOXDAG_INLINE static uint64_t word64(const uint32_t* at) {
    uint64_t word;
    std::memcpy(&word, at, sizeof(word));
    return word;
  }
  VOXDAG_INLINE uint64_t hash(uint64_t i) const { return word64(node(i)); }
  // Makes the values of node i mean "no such node". No subtree has so many voxels.
  VOXDAG_INLINE void set_broken(uint64_t i) const {
    for (uint32_t* word = node(i); word < node(i + 1); ++word) *word = ~uint32_t{0};
  }
  VOXDAG_INLINE bool is_broken(uint64_t i) const {
    return is_small ? node(i)[2] == ~uint32_t{0} : word64(node(i) + 2) == ~uint64_t{0};
  }
  // Copies the values of node i to `to`, without the bit that tells whether the node has a parent.
  // Sets this bit in the node.
  VOXDAG_INLINE void copy_to_parent(uint64_t i, uint32_t* to) const {
    uint32_t* const from = node(i);
    std::memcpy(to, from, (is_small ? 2 : 4) * sizeof(uint32_t));
    if (is_small) {
      to[2] = remove_parent_bit(from + 2, kSmallParentBit);
    } else {
      const uint64_t last = remove_parent_bit(reinterpret_cast<uint64_t*>(from + 4), kParentBit);
      std::memcpy(to + 4, &last, sizeof(last));
    }
  }
  // Sets `bit` in a word that several threads may change in this way. Returns the word without this
  // bit.
  template <class Word>
  VOXDAG_INLINE static Word remove_parent_bit(Word* at, Word bit) {
    const Word word = __atomic_load_n(at, __ATOMIC_RELAXED);
    if (!(word & bit)) __atomic_store_n(at, word | bit, __ATOMIC_RELAXED);
    return word & ~bit;
  }
};

// The tables of two consecutive levels exist at the same time. Several threads may set different
// nodes concurrently.
class SubtreeTable {
 public:
  SubtreeTable() = default;
  // Makes a table for `nodes` nodes whose cubes have 2^`cube_levels` voxels per edge.
  SubtreeTable(MemoryBudget& budget, uint64_t nodes, uint32_t cube_levels)
      : words_(budget, nodes * node_words(cube_levels), "hashes and counts of a level"),
        size_(nodes),
        is_small_(is_small(cube_levels)) {}

  // Returns the number of words per node.
  static uint32_t node_words(uint32_t cube_levels) { return is_small(cube_levels) ? 3 : 6; }

  uint64_t size() const { return size_; }
  // Returns the words of `nodes` nodes, beginning with node `first`.
  std::span<uint32_t> words_of(uint64_t first, uint64_t nodes) {
    return {words().node(first), words().node(first + nodes)};
  }
  SubtreeWords words() { return {words_.data(), is_small_}; }

  uint64_t hash(uint64_t i) const { return SubtreeWords::word64(node(i)); }
  bool has_parent(uint64_t i) const {
    return is_small_ ? node(i)[2] & SubtreeWords::kSmallParentBit
                     : SubtreeWords::word64(node(i) + 4) & SubtreeWords::kParentBit;
  }
  // Returns the values of a node without a parent.
  Subtree at(uint64_t i) const {
    const uint32_t* const from = node(i);
    if (is_small_)
      return {hash(i), from[2] & ((1u << SubtreeWords::kVoxelBits) - 1),
              from[2] >> SubtreeWords::kVoxelBits};
    return {hash(i), SubtreeWords::word64(from + 2), SubtreeWords::word64(from + 4)};
  }
  // Sets the values of a node. The node has no parent yet.
  void set(uint64_t i, const Subtree& subtree) {
    uint32_t* const to = words().node(i);
    std::memcpy(to, &subtree.hash, sizeof(subtree.hash));
    if (is_small_) {
      to[2] = static_cast<uint32_t>(subtree.voxels | subtree.svo_nodes << SubtreeWords::kVoxelBits);
    } else {
      std::memcpy(to + 2, &subtree.voxels, sizeof(subtree.voxels));
      std::memcpy(to + 4, &subtree.svo_nodes, sizeof(subtree.svo_nodes));
    }
  }

 private:
  static bool is_small(uint32_t cube_levels) {
    return cube_levels <= SubtreeWords::kMaxSmallCubeLevels;
  }
  const uint32_t* node(uint64_t i) const { return words_.data() + (is_small_ ? 3 : 6) * i; }

  PageBuffer<uint32_t> words_;
  uint64_t size_ = 0;
  bool is_small_ = true;
};

}  // namespace voxdag
