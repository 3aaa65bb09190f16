#include "query/extract/node_reader.h"

#include <algorithm>
#include <atomic>

#include "core/base/error.h"
#include "core/base/popcount8.h"
#include "core/format/checksum.h"
#include "core/format/global/global_layout.h"

namespace voxdag::query {
namespace {

constexpr uint64_t kMaxNodeWords = 17;  // a child mask and eight wide offsets
// Nodes that lie closer together than this are read at once: a read costs about as much as these
// words do.
constexpr uint64_t kGapWords = 2048;

static_assert(SourceFile::kBlockBytes == global_layout::kChecksumBlockBytes);

}  // namespace

SourceFile::SourceFile(FileSystem& files, const voxdag_reader::File& header, MemoryBudget& budget)
    : header_(header),
      file_(files.open_read(header.path())),
      intact_(budget, header.checksum_table_offset() / kBlockBytes / 64 + 1,
              "the list of checksum blocks") {}

void SourceFile::check_block(uint64_t block, std::span<std::byte> buffer) {
  const uint64_t bit = uint64_t{1} << block % 64;
  std::atomic_ref intact(intact_[block / 64]);
  if (intact.load(std::memory_order_relaxed) & bit) return;
  const uint64_t begin = global_layout::kPageBytes + block * kBlockBytes;
  const auto bytes =
      buffer.first(std::min<uint64_t>(kBlockBytes, header_.checksum_table_offset() - begin));
  file_->read_at(begin, bytes);
  uint64_t expected = 0;
  file_->read_at(header_.checksum_table_offset() + block * sizeof(expected),
                 std::as_writable_bytes(std::span(&expected, 1)));
  if (checksum64(bytes) != expected)
    throw Error(ErrorCode::kCorrupt, header_.path() + ": bytes " + std::to_string(begin) + " to " +
                                         std::to_string(begin + bytes.size() - 1) +
                                         ": the block fails its checksum");
  intact.fetch_or(bit, std::memory_order_relaxed);
}

void SourceFile::read(uint32_t level, uint64_t first, std::span<uint32_t> words,
                      std::span<std::byte> block) {
  const uint64_t begin = header_.level(level).file_offset + first * sizeof(uint32_t);
  check(begin, words.size_bytes(), block);
  file_->read_at(begin, std::as_writable_bytes(words));
}

void SourceFile::check(uint64_t begin, uint64_t bytes, std::span<std::byte> block) {
  const uint64_t end = begin + bytes - global_layout::kPageBytes;
  for (uint64_t b = (begin - global_layout::kPageBytes) / kBlockBytes; b * kBlockBytes < end; ++b)
    check_block(b, block);
}

void NodeReader::corrupt(uint32_t level, uint64_t offset) const {
  throw Error(ErrorCode::kCorrupt, source_.header().path() + ": level " + std::to_string(level) +
                                       ", word " + std::to_string(offset) + ": no node lies here");
}

size_t NodeReader::fill(uint32_t level, std::span<const WantedNode> wanted) {
  const uint64_t level_words = source_.header().level(level).word_count;
  first_ = wanted.front().offset;
  if (first_ >= level_words) corrupt(level, first_);
  uint64_t end = first_ + kMaxNodeWords;
  size_t count = 1;
  for (; count < wanted.size(); ++count) {
    const uint64_t offset = wanted[count].offset;
    if (offset > end + kGapWords || offset >= level_words ||
        offset + kMaxNodeWords > first_ + buffer_.size())
      break;
    end = offset + kMaxNodeWords;
  }
  count_ = std::min(end, level_words) - first_;
  source_.read(level, first_, {buffer_.data(), count_}, {block_.data(), block_.size()});
  return count;
}

voxdag_reader::Node NodeReader::node(uint32_t level, uint64_t offset) {
  const WantedNode wanted{offset, 0};
  fill(level, {&wanted, 1});
  return parse_node(level, offset, {buffer_.data(), count_});
}

voxdag_reader::Node NodeReader::parse_node(uint32_t level, uint64_t offset,
                                           std::span<const uint32_t> words) const {
  const uint32_t mask = words[0];
  const bool wide = source_.header().level(level + 1).pointer_bits == 64;
  if (mask == 0 || mask > 255 || uint64_t{kPopcount8[mask]} << wide >= words.size())
    corrupt(level, offset);
  return {mask, words.data() + 1, wide};
}

uint64_t NodeReader::parse_brick(uint64_t offset, std::span<const uint32_t> words) const {
  const uint64_t mask = words.size() < 2 ? 0 : words[0] | static_cast<uint64_t>(words[1]) << 32;
  if (mask == 0) corrupt(source_.header().brick_level(), offset);
  return mask;
}

}  // namespace voxdag::query
