// Fills the enclosed space of a sub-DAG: sets all empty voxels of its cube, except the voxels of
// components (space_labels.h) that reach the outside. Equal nodes with the same outside components
// are filled once. So the cost depends on the number of unique nodes.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "core/dag/consing/sub_dag_tables.h"
#include "core/dag/space/seed_place.h"
#include "core/dag/space/space_labels.h"

namespace voxdag {

// Adds the filled sub-DAG to `tables`, which must be empty and have the size of the root's cube.
// is_outside[c] is 1 if component c of the root reaches the outside, otherwise 0. Throws
// OutOfBudget. If `cancel` is not null, also throws Error{kCanceled} after a cancellation.
void fill_enclosed(PooledMemory& memory, const SpaceLabels& labels,
                   std::span<const uint8_t> is_outside, SubDagTables& tables,
                   const CancelToken* cancel = nullptr);

// Like fill_enclosed(), but does not fill components that have no voxel at the faces of the root's
// cube. If the voxel `seed` is in such a component, this component is filled nevertheless.
void fill_from_seed(PooledMemory& memory, SpaceLabels& labels, std::span<const uint8_t> is_outside,
                    const std::optional<CubeVoxel>& seed, SubDagTables& tables);

}  // namespace voxdag
