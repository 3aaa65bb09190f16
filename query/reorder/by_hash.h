// Writes the levels of a file in the total order by hash (docs/format.md, "Node order"), from the
// bricks up to the root. The order of a level depends on the new offsets of the children, so the
// finer level is always written first. Rows that do not fit in memory are sorted on the disk.
#pragma once

#include "core/base/progress.h"
#include "core/format/global/global_writer.h"
#include "query/combine/spill/spill.h"
#include "query/dag/dag_input.h"

namespace voxdag::query {

// Memory limits for the new offsets of the nodes of one level, in bytes.
struct OffsetMemory {
  uint64_t value_bytes = 0;   // if the level's offsets take more, they are stored on the disk
  uint64_t window_bytes = 0;  // memory of a window of lookups (node_values.h) of stored offsets
};

// Writes all levels of `input` to `out`. The file must have voxels. Throws Error{kCorrupt} if a
// child pointer does not refer to a node, or if two nodes of a level are equal.
void write_levels_by_hash(DagInput& input, const SpillSpace& space, const OffsetMemory& memory,
                          GlobalFileWriter& out, Progress& progress);

}  // namespace voxdag::query
