// Releases the pages of mapped files when the process exceeds its budget. Thread-safe.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/base/process_limits.h"
#include "core/format/global/voxdag_reader.h"

namespace voxdag::query {

class ResidentPages {
 public:
  // The files must outlive this object. `limit_bytes` is the limit of the resident memory.
  ResidentPages(std::vector<const voxdag_reader::File*> files, uint64_t limit_bytes,
                unsigned threads)
      : files_(std::move(files)), limit_bytes_(limit_bytes), threads_(threads) {}
  // Must be called for each node that is read. Calls check() often enough that the process remains
  // within its budget.
  void visit() const {
    thread_local uint64_t visits_left = 0;
    if (visits_left-- == 0) visits_left = check();
  }
  // Releases pages if the process is over its budget. Returns the number of nodes that this thread
  // may read before the next call.
  uint64_t check() const {
    const uint64_t bytes = resident_bytes();
    if (bytes > limit_bytes_) release();
    const uint64_t free_bytes = limit_bytes_ - std::min(bytes, limit_bytes_);
    return std::max(kMinVisits, free_bytes / kVisitBytes) / threads_;
  }
  void release() const {
    for (const voxdag_reader::File* file : files_) file->release_pages();
  }

 private:
  // Number of bytes that the system can load for one access to a page that is not in memory.
  static constexpr uint64_t kVisitBytes = uint64_t{64} << 10;
  static constexpr uint64_t kMinVisits = 512;  // these can load 32 MiB
  const std::vector<const voxdag_reader::File*> files_;
  const uint64_t limit_bytes_;
  const unsigned threads_;
};

}  // namespace voxdag::query
