// Checks the sections of colors and of other attributes of a global file whose levels are valid:
//
//   1. The tiers, sizes and counts of a section agree; padding and reserved fields are 0.
//   2. Each tier has exactly the regions where the DAG has set cells, in Morton order, and each
//      region has the counts and the prefix tables (region.h) that follow from the DAG.
//   3. Each block of colors has the canonical form of its mode: the larger of its two end colors is
//      first, and the weights of missing cells (after the last one of the region) are 0.
//   4. Values of other attributes are within their bounds. The value of a coarser cell equals the
//      value computed from its children. The bytes of missing cells are 0.
#pragma once

#include "core/base/progress.h"
#include "core/format/global/page_limit.h"
#include "core/format/global/voxdag_reader.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// Checks the sections on up to `threads` threads. Throws Error{kCorrupt}; the message names the
// problem, its place and the expected value. A file without attributes is valid.
void verify_colors(const voxdag_reader::File& file, unsigned threads, Progress& progress,
                   const CancelToken& cancel, PageLimit& pages);

}  // namespace voxdag
