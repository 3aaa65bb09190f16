// If a mapped file is truncated, or its disk fails, reading it ends the process with SIGBUS. A
// process that must survive watches its mappings: missing pages read as zeros, and the mapping
// reports them. (The rest of a truncated file's last page reads as zeros without a fault.)
// Thread-safe.
#pragma once

#include <cstdint>

namespace voxdag {

class WatchedMapping {
 public:
  // Maximum number of watched mappings; further mappings are not protected.
  static constexpr int kMaxWatched = 256;

  // The first mapping of the process installs a handler for SIGBUS permanently. Faults outside
  // watched mappings still end the process.
  WatchedMapping(const void* begin, uint64_t bytes);
  // To be called before the mapping ends.
  ~WatchedMapping();
  WatchedMapping(const WatchedMapping&) = delete;

  // True if pages of the mapping were read as zeros. If so, discard all results computed from the
  // mapping since it was created.
  bool is_damaged() const;

 private:
  int slot_ = -1;
};

}  // namespace voxdag
