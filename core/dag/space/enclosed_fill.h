// The second walk over a sub-DAG: sets all empty voxels of its cube, except the voxels of
// components that reach the outside. Equal nodes whose components are outside in the same way are
// filled once. So the cost depends on the number of unique nodes.
#pragma once

#include <cstdint>
#include <span>

#include "core/dag/consing/sub_dag_tables.h"
#include "core/dag/space/space_labels.h"

namespace voxdag {

// Adds the filled sub-DAG to `tables`, which must be empty and have the size of the root's cube.
// is_outside[c] is 1 if component c of the root reaches the outside, otherwise 0. Throws
// OutOfBudget.
void fill_enclosed(PooledMemory& memory, const SpaceLabels& labels,
                   std::span<const uint8_t> is_outside, SubDagTables& tables);

}  // namespace voxdag
