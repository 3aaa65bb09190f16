// Compares the checksum blocks of a global file with their checksums when they are used for the
// first time, for those who serve a part of a file as long as it lies on a disk and cannot wait for
// all of it to be verified (docs/format.md, "The checksum table").
//
// A block is compared again only if it was damaged: what becomes damaged on the disk after its
// first use, and is read again, is not noticed. Costs a bit per 64 KiB of the file. Thread-safe.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include "core/base/error.h"
#include "core/format/global/voxdag_reader.h"

namespace voxdag {

// Bytes of a file are not those that were written.
class DamagedBlock : public Error {
 public:
  explicit DamagedBlock(const std::string& message) : Error(ErrorCode::kCorrupt, message) {}
};

class CheckedBlocks {
 public:
  // The file, which must outlive it, has checked its header page and its checksum table.
  explicit CheckedBlocks(const voxdag_reader::File& file);

  // To be called before these bytes are read. They are the file's, behind its header page and
  // before its checksum table. Throws DamagedBlock.
  void expect_intact(const void* begin, uint64_t bytes) const {
    expect_intact_at(place_of(begin), bytes);
  }
  // The same, faster, for those who remember where an array lies: bytes behind the header page.
  uint64_t place_of(const void* begin) const {
    return static_cast<uint64_t>(static_cast<const unsigned char*>(begin) - first_);
  }
  void expect_intact_at(uint64_t place, uint64_t bytes) const {
    const uint64_t block = place / kBlockBytes;
    if (place % kBlockBytes + bytes > kBlockBytes || !is_intact(block)) compare_all(place, bytes);
  }

 private:
  static constexpr uint64_t kBlockBytes = 65536;  // whose checksums are in the table

  bool is_intact(uint64_t block) const {
    return intact_[block / 64].load(std::memory_order_relaxed) >> block % 64 & 1;
  }
  void compare_all(uint64_t place, uint64_t bytes) const;
  void compare(uint64_t block) const;

  const voxdag_reader::File& file_;
  const unsigned char* const first_;  // of the first block
  const uint64_t bytes_;              // of all blocks
  const std::unique_ptr<std::atomic<uint64_t>[]> intact_;
};

}  // namespace voxdag
