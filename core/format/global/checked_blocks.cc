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
      intact_(std::make_unique<std::atomic<uint64_t>[]>(bytes_ / kBlockBytes / 64 + 1)) {
  static_assert(kBlockBytes == global_layout::kChecksumBlockBytes);
}

// Bytes behind the last block are nobody's.
void CheckedBlocks::compare_all(uint64_t place, uint64_t bytes) const {
  const uint64_t end = std::min(place + bytes, bytes_);
  for (uint64_t block = place / kBlockBytes; block * kBlockBytes < end; ++block)
    if (!is_intact(block)) compare(block);
}

// Several threads may compare the same block at a time, to the same effect.
void CheckedBlocks::compare(uint64_t block) const {
  const uint64_t begin = block * kBlockBytes;
  const std::span<const unsigned char> bytes(first_ + begin, std::min(kBlockBytes, bytes_ - begin));
  uint64_t expected = 0;
  std::memcpy(&expected, file_.data() + file_.checksum_table_offset() + 8 * block, sizeof expected);
  if (checksum64(std::as_bytes(bytes)) != expected)
    throw DamagedBlock(file_.path() + ": the block at byte " +
                       std::to_string(global_layout::kPageBytes + begin) + " fails its checksum");
  intact_[block / 64].fetch_or(uint64_t{1} << block % 64, std::memory_order_relaxed);
}

}  // namespace voxdag
