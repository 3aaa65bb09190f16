// Checks the sections of colors and of other attributes of a global file whose levels are valid:
//
//   1. Its tiers, sizes and counts fit together; padding and reserved fields are 0.
//   2. Each tier has exactly the regions where the DAG has set cells, in Morton order, and each
//      region has exactly the counts and prefixes of the DAG's cells.
//   3. Each block of colors is in the one form that its mode has: the larger end first, 0 for cells
//      that are not there.
//   4. Values of other attributes are within their bounds, those of coarser cells are what the
//      rule makes of their children's, and the bytes of cells that are not there are 0.
#pragma once

#include "core/base/progress.h"
#include "core/format/global/voxdag_reader.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// Throws Error{kCorrupt} with what is wrong, where, and what was expected. Works on up to `threads`
// threads; a file without attributes is valid.
void verify_colors(const voxdag_reader::File& file, unsigned threads, Progress& progress,
                   const CancelToken& cancel);

}  // namespace voxdag
