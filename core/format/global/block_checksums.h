// Computes the checksums of the checksum blocks of a global file (global_layout.h). Positions are
// counted from the end of the header page.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "core/format/checksum.h"

namespace voxdag {

// Computes the checksums of bytes that are added in order.
class BlockChecksums {
 public:
  BlockChecksums() = default;
  // Continues after complete blocks with the checksums `whole_blocks`.
  explicit BlockChecksums(std::span<const uint64_t> whole_blocks)
      : checksums_(whole_blocks.begin(), whole_blocks.end()) {}

  void add(std::span<const std::byte> bytes);
  // Returns the checksums of all blocks. The last checksum covers the bytes of its block so far.
  std::vector<uint64_t> values() const;

 private:
  std::vector<uint64_t> checksums_;  // checksums of complete blocks
  Checksum64 block_;                 // checksum of the incomplete block
  size_t filled_ = 0;                // bytes in the incomplete block so far
};

// Computes the checksums of a known number of bytes that are added in any order, each byte once.
// Keeps the bytes of incomplete blocks in memory. So it needs little memory if the bytes are added
// as a few increasing sequences.
class PlacedChecksums {
 public:
  explicit PlacedChecksums(uint64_t bytes) : bytes_(bytes) {}

  void add(uint64_t position, std::span<const std::byte> bytes);
  // Returns the number of bytes that have not been added yet.
  uint64_t missing() const { return bytes_ - added_; }
  // Returns an object with the checksums of all bytes, to which more bytes can be added in order.
  // Requires missing() == 0.
  BlockChecksums finish() const;

 private:
  struct Block {
    std::vector<std::byte> bytes;
    size_t filled = 0;
  };
  void add_part(uint64_t block, size_t at, std::span<const std::byte> part);

  const uint64_t bytes_;
  uint64_t added_ = 0;
  std::vector<uint64_t> checksums_;       // 0 for a block that is not complete
  std::map<uint64_t, Block> incomplete_;  // by the number of the block
};

}  // namespace voxdag
