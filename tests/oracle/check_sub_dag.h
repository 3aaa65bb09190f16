// The invariants of a sub-DAG, for tests of its producers.
#pragma once

#include "core/dag/sub_dag.h"

namespace voxdag {

// Checks every invariant of a sub-DAG: levels are complete, masks are not 0, indices are in range,
// nodes are in the total order without duplicates, hashes are right for shape.hash_bits, and every
// node but the root has a parent. Throws Error{kCorrupt} with the first level and node that break
// an invariant.
void check_sub_dag(const SubDag& dag, const SubDagShape& shape);

}  // namespace voxdag
