// The DAG as the renderer walks it: raw words of every level, as in the global file, and cells of
// any size from the whole grid down to a voxel. What lies below a cell is its `content`:
//     a node      its word offset in its level
//     a brick     its 64-bit mask                  (size 4)
//     half a brick  the 8 bits of its 2x2x2 voxels (size 2)
//     a voxel     1                                (size 1)
// Offsets come from a file that may be damaged: each is checked, a bad one is Error{kCorrupt}.
// Immutable; any number of threads may read.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/popcount8.h"
#include "core/format/global/voxdag_reader.h"

namespace voxdag::query {

class DagView {
 public:
  // Words of levels 0 to L - 2; none at all for a scene without voxels.
  explicit DagView(std::vector<std::span<const uint32_t>> levels, uint32_t grid_levels)
      : grid_levels_(grid_levels), levels_(std::move(levels)) {}
  explicit DagView(const voxdag_reader::File& file);

  bool empty() const { return levels_.empty(); }
  uint32_t grid_levels() const { return grid_levels_; }
  int64_t resolution() const { return int64_t{1} << grid_levels_; }

  // The occupied children of a cell larger than a voxel, at `depth` below the root (0 to L - 1).
  class Children {
   public:
    uint32_t mask = 0;
    bool has(int index) const { return mask >> index & 1; }

   private:
    friend class DagView;
    const uint32_t* offsets_ = nullptr;
    uint64_t bits_ = 0;
  };
  uint64_t root() const { return grid_levels_ == kBrickLevels ? brick(0) : 0; }
  Children children(uint32_t depth, uint64_t content) const;
  // Of child `index`, which must be there; `depth` is the parent's.
  uint64_t content(uint32_t depth, const Children& children, int index) const {
    if (depth + kBrickLevels < grid_levels_) {
      const uint32_t before = children.mask & ((1u << index) - 1);
      const uint32_t offset = children.offsets_[kPopcount8[before]];
      return depth + kBrickLevels + 1 == grid_levels_ ? brick(offset) : offset;
    }
    return depth + kBrickLevels == grid_levels_ ? children.bits_ >> (8 * index) & 255 : 1;
  }

 private:
  static constexpr uint32_t kBrickLevels = 2;

  uint64_t brick(uint64_t offset) const;
  [[noreturn]] void corrupt(uint32_t level, uint64_t offset) const;

  uint32_t grid_levels_;
  std::vector<std::span<const uint32_t>> levels_;
};

inline DagView::Children DagView::children(uint32_t depth, uint64_t content) const {
  Children c;
  if (depth + kBrickLevels < grid_levels_) {
    const std::span<const uint32_t> words = levels_[depth];
    if (content >= words.size()) corrupt(depth, content);
    c.mask = words[content];
    c.offsets_ = words.data() + content + 1;
    if (c.mask == 0 || c.mask > 255 || kPopcount8[c.mask] >= words.size() - content)
      corrupt(depth, content);
    return c;
  }
  if (depth + kBrickLevels > grid_levels_) {
    c.mask = static_cast<uint32_t>(content);
    return c;
  }
  c.bits_ = content;
  for (int i = 0; i < 8; ++i) c.mask |= (content >> (8 * i) & 255 ? 1u : 0u) << i;
  return c;
}

inline uint64_t DagView::brick(uint64_t offset) const {
  const std::span<const uint32_t> words = levels_[grid_levels_ - kBrickLevels];
  const uint32_t level = grid_levels_ - kBrickLevels;
  if (words.size() < 2 || offset > words.size() - 2) corrupt(level, offset);
  const uint64_t mask = words[offset] | static_cast<uint64_t>(words[offset + 1]) << 32;
  if (mask == 0) corrupt(level, offset);
  return mask;
}

}  // namespace voxdag::query
