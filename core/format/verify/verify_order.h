// The checks of verify.h that only files in the order by first parent need (docs/format.md, "Node
// order"), and a comparison of two nodes. All functions require that the nodes and pointers of the
// level are valid.
#pragma once

#include <cstdint>

#include "core/base/memory_budget.h"
#include "core/format/global/node_index.h"
#include "core/format/global/page_limit.h"
#include "core/format/global/voxdag_reader.h"
#include "core/format/verify/subtree_table.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// Returns the node that begins at word `at` of a level above the bricks.
inline voxdag_reader::Node verified_node(const voxdag_reader::File& file, uint32_t level,
                                         uint64_t at) {
  const uint32_t* const words = file.level(level).words + at;
  return {*words, words + 1, file.level(level + 1).pointer_bits == 64};
}

// Compares two nodes or bricks of a level with equal hashes. True if the node at word `a` precedes
// the node at word `b` in the total order.
bool is_node_less(const voxdag_reader::File& file, uint32_t level, uint64_t a, uint64_t b);

// Checks that the nodes of level `level` + 1 are in the order by first parent. In this order, each
// pointer in `level` refers to a node to which an earlier pointer refers, or to the node that
// follows the last of these nodes. `index` is the index of `level`. Throws Error{kCorrupt}.
void expect_first_parents(const voxdag_reader::File& file, uint32_t level, const NodeIndex& index,
                          const CancelToken& cancel, PageLimit& pages);

// A level, and a table with the truncated hashes of its nodes.
struct HashedLevel {
  const voxdag_reader::File& file;
  uint32_t level;
  const NodeIndex& index;
  const SubtreeTable& table;
};

// Checks that no two nodes of the level are equal. Sorts the nodes by their hashes, one range of
// hashes after the other, so the memory does not depend on the size of the level. Throws
// Error{kCorrupt}.
void expect_unique(const HashedLevel& nodes, unsigned threads, MemoryBudget& budget,
                   const CancelToken& cancel);

}  // namespace voxdag
