// Compares all checksum blocks of a global file with their checksums.
#pragma once

#include "core/base/progress.h"
#include "core/format/global/page_limit.h"
#include "core/format/global/voxdag_reader.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// Reads all blocks on up to `threads` threads, as the stage "verify checksums". Throws DamagedBlock
// (checked_blocks.h) and Error{kCanceled}.
void verify_checksums(const voxdag_reader::File& file, unsigned threads, PageLimit& pages,
                      Progress& progress, const CancelToken& cancel);

}  // namespace voxdag
