// The selected cells as a DAG of the selection's grid, for formats that share equal subtrees. If
// the complete file is selected and all its pointers have 32 bits, this DAG refers to the file's
// levels without a copy. Otherwise, the DAG is built in memory that is charged to the budget.
// Subtrees that become equal because the region clips them are also shared. A node of the file that
// is completely inside the region is visited only once.
//
// Levels have the layout of the global file. A node is its child mask and the word offsets of its
// children in the next level, one word each. A brick is two words, low half first.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/base/popcount8.h"
#include "query/export/export_job.h"

namespace voxdag::query {

class SelectedDag {
 public:
  // Throws Error{kInvalidInput} if the selection has no voxels, and Error{kOutOfMemory} if a DAG
  // must be built and does not fit in the job's memory.
  explicit SelectedDag(const ExportJob& job);
  ~SelectedDag();

  uint32_t grid_levels() const { return grid_levels_; }
  uint32_t brick_level() const { return grid_levels_ - 2; }
  uint64_t voxels() const { return voxels_; }
  std::span<const uint32_t> words(uint32_t level) const { return words_[level]; }
  uint64_t node_count(uint32_t level) const { return nodes_[level]; }
  uint64_t node_count() const;
  uint64_t word_count() const;
  DagView view() const;

  // Upper bounds of the DAG's size on a coarser grid. The bricks of such a grid are made from the
  // nodes two levels above the grid's cells.
  struct Size {
    uint64_t words = 0, nodes = 0, bricks = 0;  // `nodes` does not count bricks
  };
  Size size_at(uint32_t grid_levels) const;

  // Calls visit(offset, mask, children) for each node of a level above the bricks, in the order of
  // the offsets. `children` are the children's offsets in the next level. Throws Error{kCorrupt}
  // for words that are not a node.
  template <class Visit>
  void for_each_node(uint32_t level, const Visit& visit) const {
    const std::span<const uint32_t> words = words_[level], below = words_[level + 1];
    for (uint64_t at = 0; at < words.size();) {
      const uint32_t mask = words[at];
      const auto count = static_cast<uint64_t>(popcount8(mask));
      if (mask == 0 || mask > 255 || count >= words.size() - at) corrupt(level, at);
      const std::span<const uint32_t> children = words.subspan(at + 1, count);
      for (const uint32_t child : children)
        if (below.size() < 2 || child > below.size() - 2) corrupt(level, at);
      visit(at, mask, children);
      at += 1 + count;
    }
  }
  // Calls visit(offset, mask) for each brick, in order.
  template <class Visit>
  void for_each_brick(const Visit& visit) const {
    const std::span<const uint32_t> words = words_[brick_level()];
    for (uint64_t at = 0; at + 1 < words.size(); at += 2)
      visit(at, words[at] | uint64_t{words[at + 1]} << 32);
  }

 private:
  struct Built;
  [[noreturn]] void corrupt(uint32_t level, uint64_t offset) const {
    refuse_missing_node(path_, level, offset);
  }

  uint32_t grid_levels_;
  std::string path_;
  uint64_t voxels_ = 0;
  std::vector<std::span<const uint32_t>> words_;
  std::vector<uint64_t> nodes_;
  std::unique_ptr<Built> built_;
};

// Holds one number per node or brick of a level, in memory charged to the job. The index of a
// node's number is half the node's word offset. This index is unique, because each node has at
// least two words.
template <class Number>
class NodeNumbers {
 public:
  NodeNumbers() = default;
  NodeNumbers(const ExportJob& job, const SelectedDag& dag, uint32_t level)
      : charge_(job.budget, (dag.words(level).size() / 2 + 1) * sizeof(Number),
                "a number per node of level " + std::to_string(level)),
        numbers_(dag.words(level).size() / 2 + 1) {}
  Number& operator[](uint64_t offset) { return numbers_[offset / 2]; }

 private:
  MemoryCharge charge_;
  std::vector<Number> numbers_;
};

}  // namespace voxdag::query
