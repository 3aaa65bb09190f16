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

void PlacedChecksums::add(uint64_t position, std::span<const std::byte> bytes) {
  added_ += bytes.size();
  while (!bytes.empty()) {
    const uint64_t block = position / kChecksumBlockBytes;
    const size_t at = position % kChecksumBlockBytes;
    const auto part = bytes.first(std::min<size_t>(bytes.size(), kChecksumBlockBytes - at));
    add_part(block, at, part);
    position += part.size();
    bytes = bytes.subspan(part.size());
  }
}

void PlacedChecksums::add_part(uint64_t block, size_t at, std::span<const std::byte> part) {
  if (checksums_.size() <= block) checksums_.resize(block + 1);
  if (part.size() == kChecksumBlockBytes) {
    checksums_[block] = checksum64(part);
    return;
  }
  Block& to = incomplete_[block];
  to.bytes.resize(kChecksumBlockBytes);
  std::ranges::copy(part, to.bytes.begin() + static_cast<std::ptrdiff_t>(at));
  to.filled += part.size();
  if (to.filled < kChecksumBlockBytes) return;
  checksums_[block] = checksum64(to.bytes);
  incomplete_.erase(block);
}

BlockChecksums PlacedChecksums::finish() const {
  const size_t whole_blocks = bytes_ / kChecksumBlockBytes;
  BlockChecksums all{std::span(checksums_).first(whole_blocks)};
  if (const auto last = incomplete_.find(whole_blocks); last != incomplete_.end())
    all.add(std::span(last->second.bytes).first(last->second.filled));
  return all;
}

}  // namespace voxdag
