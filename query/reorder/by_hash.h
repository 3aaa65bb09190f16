// Writes the levels of a file in the total order by hash (docs/format.md), from the bricks up to
// the root. The rows of each level are sorted on the disk if they do not fit in memory.
#pragma once

#include "core/base/progress.h"
#include "core/format/global/global_writer.h"
#include "query/combine/dag_input.h"
#include "query/combine/spill.h"

namespace voxdag::query {

// Memory for the new offsets of a level.
struct OffsetMemory {
  uint64_t value_bytes = 0;   // maximum memory of the offsets of a level
  uint64_t window_bytes = 0;  // memory of a window of lookups (node_values.h)
};

// Writes all levels. Requires that the file has voxels. Throws Error{kCorrupt} if a pointer does
// not refer to a node, or if two nodes of a level are equal.
void write_levels_by_hash(DagInput& input, const SpillSpace& space, const OffsetMemory& memory,
                          GlobalFileWriter& out, Progress& progress);

}  // namespace voxdag::query
