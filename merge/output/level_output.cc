#include "merge/output/level_output.h"

#include <algorithm>

namespace voxdag {

void ArtifactOutput::begin_level(uint32_t level) {
  level_ = level;
  artifact_.begin_level(level);
}

void ArtifactOutput::add(const MergedRows& rows) {
  if (rows.bricks())
    write_bricks(rows);
  else
    write_nodes(rows);
}

void ArtifactOutput::write_bricks(const MergedRows& rows) {
  const auto words = rows.words();
  for (size_t i = 0; i < words.size();) {
    brick_masks_.clear();
    for (; i < words.size() && brick_masks_.size() < kFrameRows; i += kBrickWords)
      brick_masks_.push_back(words[i] | uint64_t{words[i + 1]} << 32);
    artifact_.append_bricks(brick_masks_);
  }
}

void ArtifactOutput::write_nodes(const MergedRows& rows) {
  const uint32_t* word = rows.words().data();
  for (size_t row = 0; row < rows.row_count(); row += masks_.size()) {
    masks_.clear();
    children_.clear();
    for (size_t i = row; i < rows.row_count() && masks_.size() < kFrameRows; ++i) {
      masks_.push_back(static_cast<uint8_t>(*word++));
      const uint32_t* const end = word + kPopcount8[masks_.back()];
      children_.insert(children_.end(), word, end);
      word = end;
    }
    artifact_.append_nodes({level_, rows.hashes().subspan(row, masks_.size()), masks_, children_});
  }
}

}  // namespace voxdag
