// Reads small files in one step. The readers of scenes and artifacts read many small ranges, and a
// system call for each range would take longer than the work of a short build.
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>

#include "core/base/memory_budget.h"
#include "core/io/file_system.h"

namespace voxdag {

// Reads files into memory as long as there is room for them. Not thread-safe.
class SmallFiles {
 public:
  // All files together take at most `max_bytes`, and at most a sixteenth of the memory of `budget`
  // that is free now. `budget` must outlive the files.
  SmallFiles(uint64_t max_bytes, MemoryBudget& budget)
      : budget_(budget), left_bytes_(std::min(max_bytes, budget.available() / 16)) {}

  // If there is room for all bytes of `file`, reads them and returns a file that reads from memory.
  // Otherwise returns `file` unchanged. Throws Error if the bytes cannot be read.
  std::unique_ptr<ReadableFile> read(std::unique_ptr<ReadableFile> file);

 private:
  MemoryBudget& budget_;
  uint64_t left_bytes_;
};

}  // namespace voxdag
