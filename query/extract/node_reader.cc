#include "query/extract/node_reader.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/base/popcount8.h"
#include "core/format/global/global_layout.h"
#include "query/dag/dag_view.h"

namespace voxdag::query {
namespace {

// A gap of up to this number of words between two nodes is read together with them, because a
// separate call costs about as much as reading the gap.
constexpr uint64_t kGapWords = 2048;

}  // namespace

void NodeReader::corrupt(uint32_t level, uint64_t offset) const {
  refuse_missing_node(source_.header().path(), level, offset);
}

size_t NodeReader::fill(uint32_t level, std::span<const WantedNode> wanted) {
  const uint64_t level_words = source_.header().level(level).word_count;
  first_ = wanted.front().offset;
  if (first_ >= level_words) corrupt(level, first_);
  uint64_t end = first_ + global_layout::kMaxNodeWords;
  size_t count = 1;
  for (; count < wanted.size(); ++count) {
    const uint64_t offset = wanted[count].offset;
    if (offset > end + kGapWords || offset >= level_words ||
        offset + global_layout::kMaxNodeWords > first_ + buffer_.size())
      break;
    end = offset + global_layout::kMaxNodeWords;
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
