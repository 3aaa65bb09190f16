// Compares the checksum blocks of a global file with their checksums, each block when it is first
// used. The class is for readers that use a part of a file and cannot wait until the complete file
// is verified (docs/format.md, "Checksum table").
//
// An intact block is not compared again, so disk errors after its first use go unnoticed. Needs one
// bit of memory per 64 KiB of the file. Thread-safe.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "core/base/error.h"
#include "core/format/global/voxdag_reader.h"

namespace voxdag {

// Thrown if a block fails its checksum: its bytes differ from the bytes that were written.
class DamagedBlock : public Error {
 public:
  explicit DamagedBlock(const std::string& message) : Error(ErrorCode::kCorrupt, message) {}
};

class CheckedBlocks {
 public:
  static constexpr uint64_t kBlockBytes = 65536;
  // Returns the memory, in bytes, of a CheckedBlocks for a file whose checksum table begins at byte
  // `table_offset`.
  static constexpr uint64_t memory_bytes(uint64_t table_offset) {
    return sizeof(uint64_t) * (table_offset / kBlockBytes / 64 + 1);
  }

  // `file` must outlive this object. The header page and the checksum table were checked when the
  // File was opened, so they are not compared here.
  explicit CheckedBlocks(const voxdag_reader::File& file);

  // Compares the blocks that contain these bytes; skips blocks that are known to be intact. Call it
  // before the bytes are read. The bytes must be in the mapped file, after its header page and
  // before its checksum table. Throws DamagedBlock.
  void expect_intact(const void* begin, uint64_t bytes) const {
    expect_intact_at(place_of(begin), bytes);
  }
  // Returns the offset of a byte of the mapped file from the end of the header page. A caller that
  // stores this offset can call expect_intact_at(), which is faster than expect_intact().
  uint64_t place_of(const void* begin) const {
    return static_cast<uint64_t>(static_cast<const unsigned char*>(begin) - first_);
  }
  void expect_intact_at(uint64_t place, uint64_t bytes) const {
    const uint64_t block = place / kBlockBytes;
    if (place % kBlockBytes + bytes > kBlockBytes || !is_intact(block)) compare_all(place, bytes);
  }

  uint64_t count() const { return (bytes_ + kBlockBytes - 1) / kBlockBytes; }
  // True if the block was compared before and is intact.
  bool is_intact(uint64_t block) const {
    return intact_[block / 64].load(std::memory_order_relaxed) >> block % 64 & 1;
  }
  // Reads a block in the file's mapping and compares it with its checksum. Throws DamagedBlock.
  void compare(uint64_t block) const;
  // Compares a block with `expected`, its checksum in the table. `bytes` are the block's bytes,
  // which the caller has read. Throws DamagedBlock.
  void compare(uint64_t block, std::span<const std::byte> bytes, uint64_t expected) const;
  // Return the offset of a block in the file and the size of the block.
  uint64_t offset_of(uint64_t block) const;
  uint64_t size_of(uint64_t block) const;

 private:
  void compare_all(uint64_t place, uint64_t bytes) const;

  const voxdag_reader::File& file_;
  const unsigned char* const first_;  // first byte of the first block
  const uint64_t bytes_;              // size of all blocks together
  const std::unique_ptr<std::atomic<uint64_t>[]> intact_;
};

}  // namespace voxdag
