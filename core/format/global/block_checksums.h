// Computes the checksums of the checksum blocks of the global file from its bytes in order; see
// global_layout.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/format/checksum.h"

namespace voxdag {

class BlockChecksums {
 public:
  BlockChecksums() = default;
  // Continues after whole blocks with these checksums.
  explicit BlockChecksums(std::span<const uint64_t> whole_blocks)
      : checksums_(whole_blocks.begin(), whole_blocks.end()) {}

  void add(std::span<const std::byte> bytes);
  // The checksums of all blocks; that of the last one covers its bytes so far.
  std::vector<uint64_t> values() const;

 private:
  std::vector<uint64_t> checksums_;  // of whole blocks
  Checksum64 block_;                 // of the block after them
  size_t filled_ = 0;                // bytes of that block
};

}  // namespace voxdag
