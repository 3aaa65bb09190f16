#include "core/format/global/checked_blocks.h"

#include <algorithm>
#include <cstring>
#include <span>

#include "core/format/checksum.h"
#include "core/format/global/global_layout.h"

namespace voxdag {

CheckedBlocks::CheckedBlocks(const voxdag_reader::File& file)
    : file_(file),
      first_(file.data() + global_layout::kPageBytes),
      bytes_(file.checksum_table_offset() - global_layout::kPageBytes),
      intact_(std::make_unique<std::atomic<uint64_t>[]>(memory_bytes(file.checksum_table_offset()) /
                                                        sizeof(uint64_t))) {
  static_assert(kBlockBytes == global_layout::kChecksumBlockBytes);
}

uint64_t CheckedBlocks::offset_of(uint64_t block) const {
  return global_layout::kPageBytes + block * kBlockBytes;
}

uint64_t CheckedBlocks::size_of(uint64_t block) const {
  return std::min(kBlockBytes, bytes_ - block * kBlockBytes);
}

// Compares the blocks that overlap [place, place + bytes) with their stored checksums, except
// blocks that are known to be intact. `place` is a result of place_of(). Bytes after the last block
// have no checksum and are ignored.
void CheckedBlocks::compare_all(uint64_t place, uint64_t bytes) const {
  const uint64_t end = std::min(place + bytes, bytes_);
  for (uint64_t block = place / kBlockBytes; block * kBlockBytes < end; ++block)
    if (!is_intact(block)) compare(block);
}

void CheckedBlocks::compare(uint64_t block) const {
  uint64_t expected = 0;
  std::memcpy(&expected, file_.data() + file_.checksum_table_offset() + sizeof expected * block,
              sizeof expected);
  compare(block, std::as_bytes(std::span(file_.data() + offset_of(block), size_of(block))),
          expected);
}

// Several threads may compare the same block concurrently. All get the same result.
void CheckedBlocks::compare(uint64_t block, std::span<const std::byte> bytes,
                            uint64_t expected) const {
  if (checksum64(bytes) != expected)
    throw DamagedBlock(file_.path() + ": bytes " + std::to_string(offset_of(block)) + " to " +
                       std::to_string(offset_of(block) + bytes.size() - 1) +
                       ": the block fails its checksum");
  intact_[block / 64].fetch_or(uint64_t{1} << block % 64, std::memory_order_relaxed);
}

}  // namespace voxdag
