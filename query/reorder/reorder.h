// Writes a copy of a global file in which the nodes have another order (order_levels.h).
//
// The voxels and the order determine the bytes of the levels. So reordering a file and then
// reordering the result back gives the original bytes. Attribute sections do not depend on the
// order of the nodes, so their bytes are copied.
#pragma once

#include <cstdint>
#include <string>

#include "core/base/progress.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/voxdag_reader.h"
#include "core/io/file_system.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

struct ReorderSpec {
  NodeOrder order = NodeOrder::kByFirstParent;
  std::string output;
  bool replace = false;  // replace an existing file
  uint64_t memory_bytes = uint64_t{1} << 30;
  // The finished file is read back to compute its SHA-256. With 2 or more threads, a background
  // thread computes it for one part while the next part is read.
  unsigned threads = 1;
  // Maximum number of words in a narrow level. A level with more words is wide: pointers into it
  // have 64 bits instead of 32. Tests use a smaller limit.
  uint64_t narrow_words = global_layout::kNarrowLevelWords;
  // Additional limit for the memory of each list and of each level. Tests use a small limit.
  uint64_t list_bytes = ~uint64_t{0};
};

struct ReorderReport {
  uint64_t bytes = 0;
  std::string sha256;
  uint64_t work_bytes = 0;  // bytes written to temporary files
};

// Writes `file` in the new order to spec.output. The output gets its final name when it is
// complete. Temporary files are in a folder next to the output; reorder() removes this folder at
// the end, also after an error. If the process is killed, the next reorder() with the same output
// removes the folder and starts over. Throws Error: kCorrupt for a damaged file;
// kUnsupportedVersion if the file has an order that this program does not know; kNoSpace,
// kOutOfMemory, kCanceled; and the errors of LockedOutputs.
ReorderReport reorder(const voxdag_reader::File& file, const ReorderSpec& spec, FileSystem& files,
                      Progress& progress, const CancelToken& cancel);

}  // namespace voxdag::query
