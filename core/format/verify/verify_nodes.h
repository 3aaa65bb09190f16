// Checks the rules 2 to 5 of verify.h: the nodes of all levels, and the numbers of voxels and
// octree nodes in the header. Goes from the bricks to the root. For each level, one pass over its
// nodes checks them and computes their values (subtree_table.h) from the values of their children.
// The values are in memory if they fit in three quarters of the free memory. Otherwise, they are in
// scratch files, which child_values.h reads in windows.
#pragma once

#include "core/format/verify/checked_level.h"

namespace voxdag {

// Throws Error{kCorrupt} if a rule is broken.
void verify_nodes(const VerifyTask& task);

}  // namespace voxdag
