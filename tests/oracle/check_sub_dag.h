// Checks the invariants of a sub-DAG, for tests of the code that makes sub-DAGs.
#pragma once

#include "core/dag/sub_dag.h"

namespace voxdag {

// Checks every invariant of a sub-DAG: levels are complete, masks are not 0, indices are in range,
// nodes are in the total order without duplicates, hashes are correct for shape.hash_bits, and
// every node except the root has a parent. Throws Error{kCorrupt} with the first level and node
// that break an invariant.
void check_sub_dag(const SubDag& dag, const SubDagShape& shape);

}  // namespace voxdag
