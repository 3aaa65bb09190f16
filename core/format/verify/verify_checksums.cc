#include "core/format/verify/verify_checksums.h"

#include <algorithm>
#include <cstdint>

#include "core/base/parallel_for.h"
#include "core/format/global/checked_blocks.h"
#include "core/format/global/global_layout.h"

namespace voxdag {

void verify_checksums(const voxdag_reader::File& file, unsigned threads, PageLimit& pages,
                      Progress& progress, const CancelToken& cancel) {
  constexpr uint64_t kBlocksPerItem = 64;  // 4 MiB together
  constexpr uint64_t kItemBytes = kBlocksPerItem * CheckedBlocks::kBlockBytes;
  const uint64_t bytes = file.checksum_table_offset() - global_layout::kPageBytes;
  const CheckedBlocks checked(file);
  const uint64_t blocks = checked.count();
  progress.begin_stage("verify checksums", bytes, "bytes");
  parallel_for(threads, (blocks + kBlocksPerItem - 1) / kBlocksPerItem, [&](unsigned, size_t item) {
    const uint64_t first = item * kBlocksPerItem;
    const uint64_t end = std::min(first + kBlocksPerItem, blocks);
    for (uint64_t block = first; block < end; ++block) checked.compare(block);
    const uint64_t read = std::min(kItemBytes, bytes - item * kItemBytes);
    progress.advance(read);
    pages.touch(read);
    cancel.check();
  });
  progress.end_stage();
}

}  // namespace voxdag
