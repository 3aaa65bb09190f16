// The checksums of the global file's blocks, made as its bytes come; see global_layout.h.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/format/checksum.h"

namespace voxdag {

class BlockSums {
 public:
  BlockSums() = default;
  // Goes on after blocks that have these.
  explicit BlockSums(std::span<const uint64_t> whole_blocks)
      : checksums_(whole_blocks.begin(), whole_blocks.end()) {}

  void add(std::span<const std::byte> bytes);
  // Of all blocks, the last one as far as it got.
  std::vector<uint64_t> checksums() const;

 private:
  std::vector<uint64_t> checksums_;  // of whole blocks
  Checksum64 block_;                 // of the one after them
  size_t filled_ = 0;                // bytes of it
};

}  // namespace voxdag
