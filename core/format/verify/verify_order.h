// The checks of verify.h that only files in the order by first parent need (docs/format.md, "Node
// order"), and a comparison of two nodes. All functions require that the nodes and pointers of the
// level are valid.
#pragma once

#include <cstdint>

#include "core/format/global/voxdag_reader.h"
#include "core/format/verify/checked_level.h"

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
// follows the last of these nodes. `level` is the number of `nodes`. Throws Error{kCorrupt}.
void expect_first_parents(const VerifyTask& task, const CheckedLevel& nodes);

// Checks that no two nodes of the level are equal. Sorts the nodes by their hashes, one range of
// hashes after the other, so the memory does not depend on the size of the level. If the level is
// stored, writes the hashes of all ranges to a scratch file first. Throws Error{kCorrupt}.
void expect_unique(const VerifyTask& task, const CheckedLevel& nodes);

}  // namespace voxdag
