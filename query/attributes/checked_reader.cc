#include "query/attributes/checked_reader.h"

#include "core/format/global/global_layout.h"

namespace voxdag::query {

CheckedReader::CheckedReader(FileSystem& files, const voxdag_reader::File& header,
                             MemoryBudget& budget)
    : header_(header),
      file_(files.open_read(header.path())),
      charge_(budget, CheckedBlocks::memory_bytes(header.checksum_table_offset()),
              "the list of checksum blocks"),
      blocks_(header) {}

void CheckedReader::check_block(uint64_t block, std::span<std::byte> buffer) {
  if (blocks_.is_intact(block)) return;
  const auto bytes = buffer.first(blocks_.size_of(block));
  file_->read_at(blocks_.offset_of(block), bytes);
  uint64_t expected = 0;
  file_->read_at(header_.checksum_table_offset() + block * sizeof(expected),
                 std::as_writable_bytes(std::span(&expected, 1)));
  blocks_.compare(block, bytes, expected);
}

void CheckedReader::read(uint32_t level, uint64_t first, std::span<uint32_t> words,
                         std::span<std::byte> block) {
  const uint64_t begin = header_.level(level).file_offset + first * sizeof(uint32_t);
  check(begin, words.size_bytes(), block);
  file_->read_at(begin, std::as_writable_bytes(words));
}

void CheckedReader::check(uint64_t begin, uint64_t bytes, std::span<std::byte> block) {
  const uint64_t end = begin + bytes - global_layout::kPageBytes;
  for (uint64_t b = (begin - global_layout::kPageBytes) / kBlockBytes; b * kBlockBytes < end; ++b)
    check_block(b, block);
}

}  // namespace voxdag::query
