// Checks every invariant of a global file:
//
//   1. The header, sizes, widths of pointers and checksums are valid. All reserved fields and all
//      padding are 0.
//   2. Every node has a child mask of 1 to 255, and its child offsets point to the beginnings of
//      nodes of the next level. No brick is empty.
//   3. The nodes of a level are in the order that the header names, and no two of them are equal.
//      In the order by hash, they strictly increase in the total order (hash, mask, child indices).
//      The hashes are computed from the bricks up.
//   4. There is one root, and every other node has a parent.
//   5. The numbers of voxels and octree nodes in the header equal the numbers that are computed
//      from the DAG.
//   6. Colors and other attributes satisfy the rules in verify_colors.h.
//
// Without scratch files, needs memory for two consecutive levels, charged to the budget: 2 bits per
// word, and 12 bytes per node, or 24 bytes per node of levels whose cubes have more than 32 voxels
// per edge. If the nodes are in the order by first parent, each thread needs up to 64 MiB more.
//
// With scratch files, keeps within the budget. The data of a level that does not fit is in scratch
// files: 12 or 24 bytes per node of two levels, 16 or 28 bytes per pointer of one level, and in the
// order by first parent 16 bytes per node. Needs about 16 MiB, and 32 bytes per 256 KiB of a level.
// If the file's hashes are truncated (fewer than 64 hash bits), the order by first parent also
// needs 16 bytes per node of the largest group of equal hashes.
//
// All threads work on the same level. The result does not depend on the number of threads or the
// memory.
#pragma once

#include <cstdint>
#include <string>

#include "core/base/memory_budget.h"
#include "core/base/progress.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/page_limit.h"
#include "core/format/global/voxdag_reader.h"
#include "core/format/verify/verify_scratch.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// Checks the file on up to `threads` threads. Throws Error{kCorrupt}; the message names the
// problem, its place and the expected value. A level must be wide if and only if it has more than
// `narrow_words` words. If `is_quick` is true and the nodes are in the order by first parent, does
// not search for equal nodes. If `pages` is not null, reports to it the bytes that were read. If
// `scratch` is null, does not write scratch files. Throws Error{kNoSpace} if its disk is full.
void verify_global_file(const voxdag_reader::File& file, unsigned threads, MemoryBudget& budget,
                        Progress& progress, const CancelToken& cancel,
                        uint64_t narrow_words = global_layout::kNarrowLevelWords,
                        bool is_quick = false, PageLimit* pages = nullptr,
                        VerifyScratch* scratch = nullptr);

}  // namespace voxdag
