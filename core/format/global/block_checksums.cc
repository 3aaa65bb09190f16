#include "core/format/global/block_checksums.h"

#include <algorithm>

#include "core/format/global/global_layout.h"

namespace voxdag {

using global_layout::kChecksumBlockBytes;

void BlockChecksums::add(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const auto part = bytes.first(std::min<size_t>(bytes.size(), kChecksumBlockBytes - filled_));
    block_.add(part);
    filled_ += part.size();
    bytes = bytes.subspan(part.size());
    if (filled_ < kChecksumBlockBytes) return;
    checksums_.push_back(block_.value());
    block_.reset();
    filled_ = 0;
  }
}

std::vector<uint64_t> BlockChecksums::values() const {
  std::vector<uint64_t> all = checksums_;
  if (filled_ > 0) all.push_back(block_.value());
  return all;
}

}  // namespace voxdag
