// A mapped file that is truncated, or whose disk fails, ends the process that reads it by SIGBUS. A
// process that has to live on watches its mappings: pages that are gone read as zeros, and the
// mapping says so. (What a truncated file leaves of its last page reads as zeros without a fault.)
// Thread-safe.
#pragma once

#include <cstdint>

namespace voxdag {

class WatchedMapping {
 public:
  // At most this many are watched at a time; others are as they would be without.
  static constexpr int kMaxWatched = 256;

  // The first one of the process installs a handler for SIGBUS, for good. What is no fault of a
  // watched mapping still ends the process.
  WatchedMapping(const void* begin, uint64_t bytes);
  // To be called before the mapping ends.
  ~WatchedMapping();
  WatchedMapping(const WatchedMapping&) = delete;

  // Whether pages of it were read as zeros. What was computed from the mapping since it began is to
  // be thrown away then.
  bool is_damaged() const;

 private:
  int slot_ = -1;
};

}  // namespace voxdag
