// Checks every invariant of a global file:
//
//   1. Header, sizes, widths of pointers, checksums, zeros in all reserved fields and padding.
//   2. Every node has a child mask of 1 to 255, and its children begin nodes of the next level. No
//      brick is empty.
//   3. Levels strictly increase in the total order (hash, mask, child indices), the hashes
//      computed from the bricks up. So no two nodes of a level are equal.
//   4. One root; every other node has a parent.
//   5. The header's voxels and octree nodes equal the DAG's.
//   6. Colors and other attributes follow core/format/global/verify_colors.h.
//
// Memory: 2 bits per word of the file, and 9 bytes per node of two levels, charged to the budget.
// All threads work on the same level; the result does not depend on their number.
#pragma once

#include <cstdint>
#include <string>

#include "core/base/memory_budget.h"
#include "core/base/progress.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/voxdag_reader.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// Throws Error{kCorrupt} with the problem, the place and the expectation. Works on up to `threads`
// threads. A level must be wide if it has more than `narrow_words` words, and must not be wide
// otherwise.
void verify_global_file(const voxdag_reader::File& file, unsigned threads, MemoryBudget& budget,
                        Progress& progress, const CancelToken& cancel,
                        uint64_t narrow_words = global_layout::kNarrowLevelWords);

}  // namespace voxdag
