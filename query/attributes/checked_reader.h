// Reads ranges of a global file with read calls, and verifies their checksum blocks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "core/base/memory_budget.h"
#include "core/format/global/checked_blocks.h"
#include "core/format/global/voxdag_reader.h"
#include "core/io/file_system.h"

namespace voxdag::query {

// Reads ranges of a global file and verifies the checksum blocks that overlap these ranges.
// Thread-safe.
class CheckedReader {
 public:
  // `header` is the opened file to read. The reader uses only its header, and reads everything else
  // with read calls.
  CheckedReader(FileSystem& files, const voxdag_reader::File& header, MemoryBudget& budget);

  const voxdag_reader::File& header() const { return header_; }
  // Fills `words` with the words of the level from word `first` on. `block` is scratch memory of
  // kBlockBytes bytes. Throws Error{kCorrupt} for a block that fails its checksum.
  void read(uint32_t level, uint64_t first, std::span<uint32_t> words, std::span<std::byte> block);

  // Verifies the checksum blocks that contain `bytes` bytes from the file offset `begin` on, as
  // read() does.
  void check(uint64_t begin, uint64_t bytes, std::span<std::byte> block);

  static constexpr uint64_t kBlockBytes = CheckedBlocks::kBlockBytes;

 private:
  void check_block(uint64_t block, std::span<std::byte> buffer);

  const voxdag_reader::File& header_;
  const std::unique_ptr<ReadableFile> file_;
  const MemoryCharge charge_;
  const CheckedBlocks blocks_;
};

}  // namespace voxdag::query
