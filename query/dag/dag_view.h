// Presents a finished DAG as cells of any size, from the complete grid down to a voxel. The view
// reads each level's words in place, in the layout of the global file. A cell's `depth` is its
// number of levels below the root; L is the grid's number of levels. A cell's `content` is a number
// that identifies the part of the DAG below the cell:
//     cell                           depth        content
//     a node                         0 to L - 3   the node's word offset in its level
//     a brick (4x4x4 voxels)         L - 2        the brick's 64-bit mask
//     an octant of a brick (2x2x2)   L - 1        the mask of the octant's 8 voxels
//     a voxel                        L            1
// The file can be damaged, so every offset is checked. A bad offset throws Error{kCorrupt}.
// Immutable; any number of threads may read concurrently.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/base/host_device.h"
#include "core/base/popcount8.h"
#include "core/dag/brick.h"
#include "core/format/global/voxdag_reader.h"
#include "query/dag/vec.h"

namespace voxdag::query {

// Throws Error{kCorrupt} because a parent points to a word of the file at which no node begins.
// `level` and `offset` are the place of that word.
[[noreturn]] void refuse_missing_node(const std::string& path, uint32_t level, uint64_t offset);

class DagView {
 public:
  // The 32-bit words of a level, in the layout of the global file (docs/format.md). If `wide` is
  // true, a pointer to a node of this level takes two words, low half first.
  struct Level {
    std::span<const uint32_t> words;
    bool wide = false;
  };
  // `levels`: the levels 0 to L - 2 of the DAG, or no levels for a scene without voxels. `path`
  // names the file in errors.
  DagView(std::vector<Level> levels, uint32_t grid_levels, std::string path)
      : grid_levels_(grid_levels), levels_(std::move(levels)), path_(std::move(path)) {}
  explicit DagView(const voxdag_reader::File& file);

  bool empty() const { return levels_.empty(); }
  uint32_t grid_levels() const { return grid_levels_; }
  // Returns the words of the level at `depth`, 0 to L - 2. The DAG must not be empty.
  const Level& level(uint32_t depth) const { return levels_[depth]; }
  // Prefetches the node or brick at this word offset of the level at `depth` into the CPU's cache.
  // Does nothing if the level has no such word.
  VOXDAG_PREFETCH void prefetch(uint32_t depth, uint64_t offset) const {
    const std::span<const uint32_t> words = levels_[depth].words;
    if (offset < words.size()) __builtin_prefetch(words.data() + offset);
  }
  [[noreturn]] void corrupt(uint32_t level, uint64_t offset) const {
    refuse_missing_node(path_, level, offset);
  }
  int64_t resolution() const { return int64_t{1} << grid_levels_; }

  // The occupied children of a cell that is larger than a voxel. Bit i of `mask` is set if child i
  // is occupied. A child's index is 4x + 2y + z, where x, y and z are 1 in the upper half of the
  // cell on that axis.
  class Children {
   public:
    uint32_t mask = 0;
    bool has(int index) const { return mask >> index & 1; }

   private:
    friend class DagView;
    voxdag_reader::Node node_;
    uint64_t bits_ = 0;
  };
  // Returns the mask of the brick at this word offset.
  uint64_t brick(uint64_t offset) const;
  uint64_t root() const { return grid_levels_ == kBrickLevels ? brick(0) : 0; }
  Children children(uint32_t depth, uint64_t content) const;
  // Returns the children of a node, by its word offset. `depth` is less than L - 2.
  Children children_of_node(uint32_t depth, uint64_t offset) const;
  // Returns the word offset of a node's child `index`, which must be occupied.
  uint64_t offset(const Children& children, int index) const {
    return children.node_.child(kPopcount8[children.mask & ((1u << index) - 1)]);
  }
  // Returns the content of a parent's child `index`, which must be occupied. `depth` is the
  // parent's depth.
  uint64_t content(uint32_t depth, const Children& children, int index) const {
    if (depth + kBrickLevels < grid_levels_) {
      const uint64_t offset = this->offset(children, index);
      return depth + kBrickLevels + 1 == grid_levels_ ? brick(offset) : offset;
    }
    return depth + kBrickLevels == grid_levels_ ? children.bits_ >> (8 * index) & 255 : 1;
  }

  struct Cell {
    uint32_t depth = 0;  // number of levels below the root
    double edge = 0;     // resolution() / 2^depth voxels
    Vec low;             // low corner, in voxels
  };
  // Calls `visit` with each occupied cell at `depth` (0 to L). On the way down, calls `select` with
  // each cell above that depth; `select` returns the mask of the children to descend into. The DAG
  // must not be empty.
  template <class Select, class Visit>
  void for_each_cell(uint32_t depth, const Select& select, const Visit& visit) const {
    visit_below({0, static_cast<double>(resolution()), {}}, root(), depth, select, visit);
  }

 private:
  template <class Select, class Visit>
  void visit_below(const Cell& cell, uint64_t content, uint32_t depth, const Select& select,
                   const Visit& visit) const;

  uint32_t grid_levels_;
  std::vector<Level> levels_;
  std::string path_;
};

inline DagView::Children DagView::children_of_node(uint32_t depth, uint64_t offset) const {
  Children c;
  const std::span<const uint32_t> words = levels_[depth].words;
  const bool wide = levels_[depth + 1].wide;
  if (offset >= words.size()) corrupt(depth, offset);
  c.mask = words[offset];
  c.node_ = {c.mask, words.data() + offset + 1, wide};
  if (c.mask == 0 || c.mask > 255 || uint64_t{kPopcount8[c.mask]} << wide >= words.size() - offset)
    corrupt(depth, offset);
  return c;
}

inline DagView::Children DagView::children(uint32_t depth, uint64_t content) const {
  if (depth + kBrickLevels < grid_levels_) return children_of_node(depth, content);
  Children c;
  if (depth + kBrickLevels > grid_levels_) {
    c.mask = static_cast<uint32_t>(content);
    return c;
  }
  c.bits_ = content;
  c.mask = octants(content);
  return c;
}

// Returns the 4x4x4 cells two levels below a node or brick at `depth` as a mask: a bit is set if
// the cell is occupied. The bits have the same order as in a brick's mask.
inline uint64_t brick_of_cells(const DagView& dag, uint32_t depth,
                               const DagView::Children& children) {
  uint64_t mask = 0;
  for (int i = 0; i < 8; ++i)
    if (children.has(i))
      mask |= uint64_t{dag.children(depth + 1, dag.content(depth, children, i)).mask} << (8 * i);
  return mask;
}
inline uint64_t brick_of_cells(const DagView& dag, uint32_t depth, uint64_t content) {
  if (depth + kBrickLevels == dag.grid_levels()) return content;
  return brick_of_cells(dag, depth, dag.children(depth, content));
}

template <class Select, class Visit>
void DagView::visit_below(const Cell& cell, uint64_t content, uint32_t depth, const Select& select,
                          const Visit& visit) const {
  if (cell.depth == depth) return visit(cell);
  const uint32_t selected = select(cell);
  if (selected == 0) return;
  const Children c = children(cell.depth, content);
  const double half = cell.edge / 2;
  // The order begins with two opposite corners. For a search for a bounding box, these two children
  // give a large box, so the search can skip most of the other children.
  for (const int i : {0, 7, 3, 4, 5, 2, 1, 6}) {
    if (!(selected & c.mask & 1u << i)) continue;
    const Vec low = cell.low + Vec{{i & 4 ? half : 0, i & 2 ? half : 0, i & 1 ? half : 0}};
    visit_below({cell.depth + 1, half, low}, this->content(cell.depth, c, i), depth, select, visit);
  }
}

inline uint64_t DagView::brick(uint64_t offset) const {
  const std::span<const uint32_t> words = levels_[grid_levels_ - kBrickLevels].words;
  const uint32_t level = grid_levels_ - kBrickLevels;
  if (words.size() < 2 || offset > words.size() - 2) corrupt(level, offset);
  const uint64_t mask = words[offset] | static_cast<uint64_t>(words[offset + 1]) << 32;
  if (mask == 0) corrupt(level, offset);
  return mask;
}

}  // namespace voxdag::query
