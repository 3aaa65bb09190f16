// Protects a process from unreadable pages of a mapped file. If the file is truncated or its disk
// fails, reading the mapping would end the process with SIGBUS. In a watched mapping these pages
// read as zeros instead, and is_damaged() becomes true. (After a truncation, the end of the file's
// last page reads as zeros without a fault, so is_damaged() remains false.) Thread-safe.
#pragma once

#include <cstdint>

namespace voxdag {

class WatchedMapping {
 public:
  // Maximum number of WatchedMappings that exist concurrently; further mappings are not protected.
  static constexpr int kMaxWatched = 256;

  // Watches `bytes` bytes from `begin`. The first WatchedMapping installs a handler for SIGBUS,
  // which remains until the process exits. Faults outside watched mappings still end the process,
  // unless the process had another SIGBUS handler before.
  WatchedMapping(const void* begin, uint64_t bytes);
  // Destroy this object before the memory is unmapped.
  ~WatchedMapping();
  WatchedMapping(const WatchedMapping&) = delete;

  // True if a page of the mapping could not be read and was replaced by zeros. Then discard all
  // results that were computed from the mapping since this object was created.
  bool is_damaged() const;

 private:
  int slot_ = -1;
};

}  // namespace voxdag
