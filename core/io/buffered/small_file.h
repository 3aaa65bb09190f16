// Reads a small file in one step. The readers of scenes and artifacts read many small ranges, and a
// system call for each range would take longer than the work of a short build.
#pragma once

#include <cstdint>
#include <memory>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"

namespace voxdag {

// If `file` has at most `max_bytes` bytes, reads all of them and returns a file that reads from
// memory. Otherwise, or if the bytes would take more than a sixteenth of the free budget, returns
// `file` unchanged. The caller limits the total size of several files. Charges the bytes to
// `budget`, which must outlive the returned file. Throws Error if the bytes cannot be read.
std::unique_ptr<ReadableFile> read_if_small(std::unique_ptr<ReadableFile> file, uint64_t max_bytes,
                                            MemoryBudget& budget);

}  // namespace voxdag
