// The invariants of a sub-DAG, for tests of its producers.
#pragma once

#include "core/dag/sub_dag.h"

namespace voxdag {

// Checks every invariant of a sub-DAG: levels complete, masks not 0, indices in range, total order
// without duplicates, hashes right for shape.hash_bits, every node but the root used by a parent.
// Throws Error{kCorrupt} naming the first level and node that break one.
void check_sub_dag(const SubDag& dag, const SubDagShape& shape);

}  // namespace voxdag
