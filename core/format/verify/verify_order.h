// Checks of verify.h for files whose nodes are in the order by first parent, and the comparison of
// nodes. The functions require that all nodes and pointers of the level are valid.
#pragma once

#include <cstdint>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "core/format/global/node_index.h"
#include "core/format/global/voxdag_reader.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// Returns the node that begins at word `at` of a level above the bricks.
inline voxdag_reader::Node verified_node(const voxdag_reader::File& file, uint32_t level,
                                         uint64_t at) {
  const uint32_t* const words = file.level(level).words + at;
  return {*words, words + 1, file.level(level + 1).pointer_bits == 64};
}

// True if the node or brick at word `a` is before the one at word `b` in the total order of nodes
// whose hashes are equal.
bool is_node_less(const voxdag_reader::File& file, uint32_t level, uint64_t a, uint64_t b);

// Checks that the nodes of the next level are in the order by first parent: walking the pointers of
// `level`, each pointer refers to the next new node or to an earlier node. Throws Error{kCorrupt}.
void expect_first_parents(const voxdag_reader::File& file, uint32_t level, const NodeIndex& index,
                          const CancelToken& cancel);

// A level with the truncated hashes of its nodes.
struct HashedLevel {
  const voxdag_reader::File& file;
  uint32_t level;
  const NodeIndex& index;
  const PageBuffer<uint64_t>& hashes;
};

// Checks that no two nodes of the level are equal. Sorts the nodes by their hashes, one range of
// hashes after the other, so the memory does not depend on the size of the level. Throws
// Error{kCorrupt}.
void expect_unique(const HashedLevel& nodes, unsigned threads, MemoryBudget& budget,
                   const CancelToken& cancel);

}  // namespace voxdag
