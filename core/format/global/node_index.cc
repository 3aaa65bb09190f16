#include "core/format/global/node_index.h"

#include "core/base/error.h"
#include "core/base/popcount8.h"

namespace voxdag {

NodeIndex::NodeIndex(const voxdag_reader::Level& level, bool bricks, MemoryBudget& budget,
                     const std::string& where)
    : bricks_(bricks), words_(level.word_count) {
  const auto miscounted = [&](uint64_t nodes) {
    throw Error(ErrorCode::kCorrupt, where + ": its words hold " + std::to_string(nodes) +
                                         " nodes, expected " + std::to_string(level.node_count));
  };
  if (bricks) {
    if (words_ != 2 * level.node_count) miscounted(words_ / 2);
    return;
  }
  starts_ = PageBuffer<uint64_t>(budget, words_ / 64 + 1, "an index of nodes");
  nodes_before_ = PageBuffer<uint32_t>(budget, words_ / 64 + 1, "an index of nodes");
  uint64_t nodes = 0, at = 0;
  for (; at < words_; ++nodes) {
    const uint32_t mask = level.words[at];
    if (mask == 0 || mask > 255)
      throw Error(ErrorCode::kCorrupt, where + ", word " + std::to_string(at) + ": child mask " +
                                           std::to_string(mask) + ", expected 1 to 255");
    starts_[at / 64] |= uint64_t{1} << at % 64;
    at += 1 + uint64_t{kPopcount8[mask]};
  }
  if (at != words_)
    throw Error(ErrorCode::kCorrupt, where + ": its last node ends at word " + std::to_string(at) +
                                         ", the level at word " + std::to_string(words_));
  if (nodes != level.node_count) miscounted(nodes);
  uint32_t before = 0;
  for (size_t i = 0; i < starts_.size(); ++i) {
    nodes_before_[i] = before;
    before += static_cast<uint32_t>(popcount64(starts_[i]));
  }
}

}  // namespace voxdag
