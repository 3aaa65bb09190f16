// Counts the voxels in which two global files differ, by walking both DAGs together. The results of
// compared pairs of nodes are remembered, so the cost depends on the number of different pairs, not
// on the number of voxels. The files must have the same grid. Their hash bits and the order of
// their nodes can differ. The result does not depend on the number of threads.
#pragma once

#include <cstdint>
#include <string>

#include "core/base/memory_budget.h"
#include "core/format/global/voxdag_reader.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

struct DiffReport {
  uint64_t only_a = 0;  // voxels that only the first file has
  uint64_t only_b = 0;  // voxels that only the second file has
  bool same() const { return only_a == 0 && only_b == 0; }
};

// Throws Error{kInvalidInput} if the resolutions or the bounds of two files differ. The message
// begins with "only files of the same grid can be" and `what`, such as "compared".
void expect_same_grid(const voxdag_reader::File& a, const voxdag_reader::File& b,
                      const std::string& what);

// Counts the differing voxels on up to `threads` threads. Throws Error{kInvalidInput} if the
// resolutions or bounds differ, Error{kCorrupt} for a damaged file. Needs 43 to 86 bytes of memory
// per compared pair of nodes, charged to the budget.
DiffReport diff_global_files(const voxdag_reader::File& a, const voxdag_reader::File& b,
                             unsigned threads, MemoryBudget& budget, const CancelToken& cancel);

}  // namespace voxdag
