#include "query/export/outside/filled_dag.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/dag/space/enclosed_fill.h"

namespace voxdag::query {
namespace {

std::string filled_memory() {
  return "the search for enclosed space (" + option_text("outside") + ")";
}

// Reads the levels of a DAG, from the bricks upwards.
class LevelReader {
 public:
  LevelReader(const DagView& dag, uint32_t grid_levels, PooledMemory& memory,
              const CancelToken& cancel)
      : dag_(dag), depth_(grid_levels - kBrickLevels), memory_(memory), cancel_(cancel) {}

  NodeLevels read() {
    read_bricks();
    levels_.nodes.resize(depth_);
    for (uint32_t depth = depth_; depth-- > 0;) read_nodes(depth);
    return std::move(levels_);
  }

 private:
  // Calls visit(offset, children) for each node of a level, in the order of the offsets.
  template <class Visit>
  void for_each_node(uint32_t depth, const Visit& visit) const {
    const bool wide = dag_.level(depth + 1).wide;
    uint64_t nodes = 0;
    for (uint64_t at = 0; at < dag_.level(depth).words.size();) {
      if (nodes++ % kNodesPerCheck == 0) cancel_.check();
      const DagView::Children children = dag_.children_of_node(depth, at);
      visit(at, children);
      at += 1 + (static_cast<uint64_t>(popcount8(children.mask)) << wide);
    }
  }
  // Returns an array for the row numbers (in NodeLevels) of a level's nodes or bricks. The row
  // number of the node or brick at word offset `offset` is stored at position offset / 2. Each of
  // them has at least two words, so no two have the same position.
  PooledArray<uint32_t> row_numbers(uint32_t depth) const {
    return {memory_, dag_.level(depth).words.size() / 2 + 1};
  }
  static uint32_t row_of(uint64_t rows) {
    if (rows >= UINT32_MAX) throw OutOfBudget();
    return static_cast<uint32_t>(rows);
  }

  void read_bricks() {
    rows_ = row_numbers(depth_);
    levels_.bricks = PooledArray<uint64_t>(memory_, dag_.level(depth_).words.size() / 2 + 1);
    const auto add = [&](uint64_t offset, uint64_t mask) {
      rows_[offset / 2] = row_of(levels_.brick_rows);
      levels_.bricks[levels_.brick_rows++] = mask;
    };
    if (depth_ + kBrickLevels == dag_.grid_levels())
      for (uint64_t at = 0; at + 1 < dag_.level(depth_).words.size(); at += 2)
        add(at, dag_.brick(at));
    else
      for_each_node(depth_, [&](uint64_t offset, const DagView::Children& children) {
        add(offset, brick_of_cells(dag_, depth_, children));
      });
  }

  void read_nodes(uint32_t depth) {
    NodeLevels::Level& level = levels_.nodes[depth];
    const uint64_t words = dag_.level(depth).words.size();
    if (words > UINT32_MAX) throw OutOfBudget();
    PooledArray<uint32_t> rows = row_numbers(depth);
    level.masks = PooledArray<uint8_t>(memory_, words / 2 + 1);
    level.first_child = PooledArray<uint32_t>(memory_, words / 2 + 1);
    level.children = PooledArray<uint32_t>(memory_, words);
    uint32_t used = 0;
    for_each_node(depth, [&](uint64_t offset, const DagView::Children& children) {
      const uint32_t row = row_of(level.rows++);
      rows[offset / 2] = row;
      level.masks[row] = static_cast<uint8_t>(children.mask);
      level.first_child[row] = used;
      for (int i = 0; i < 8; ++i)
        if (children.has(i)) level.children[used++] = row_of_child(depth, children, i);
    });
    rows_ = std::move(rows);
  }
  uint32_t row_of_child(uint32_t depth, const DagView::Children& children, int i) const {
    const uint64_t offset = dag_.offset(children, i);
    if (offset >= dag_.level(depth + 1).words.size()) dag_.corrupt(depth + 1, offset);
    const uint32_t row = rows_[offset / 2];
    if (row >= levels_.rows(static_cast<int>(depth) + 1)) dag_.corrupt(depth + 1, offset);
    return row;
  }

  const DagView& dag_;
  const uint32_t depth_;  // depth of the bricks
  static constexpr uint64_t kNodesPerCheck = 4096;

  PooledMemory& memory_;
  const CancelToken& cancel_;
  NodeLevels levels_;
  PooledArray<uint32_t> rows_;  // rows of the level that was read last
};

// Converts a sub-DAG to the words of a DagView, from the bricks upwards.
class WordLevels : public SubDagSink {
 public:
  explicit WordLevels(MemoryBudget& budget) : budget_(budget) {}

  void bricks(const BrickLevelView& level) override {
    PageBuffer<uint32_t>& words = add_level(2 * level.masks.size());
    offsets_ = PageBuffer<uint32_t>(budget_, level.masks.size(), filled_memory());
    for (size_t i = 0; i < level.masks.size(); ++i) {
      words[2 * i] = static_cast<uint32_t>(level.masks[i]);
      words[2 * i + 1] = static_cast<uint32_t>(level.masks[i] >> 32);
      offsets_[i] = static_cast<uint32_t>(2 * i);
    }
  }
  void nodes(const NodeLevelView& level) override {
    PageBuffer<uint32_t>& words = add_level(level.masks.size() + level.children.size());
    PageBuffer<uint32_t> offsets(budget_, level.masks.size(), filled_memory());
    size_t used = 0, child = 0;
    for (size_t i = 0; i < level.masks.size(); ++i) {
      offsets[i] = static_cast<uint32_t>(used);
      words[used++] = level.masks[i];
      for (int count = popcount8(level.masks[i]); count-- > 0;)
        words[used++] = offsets_[level.children[child++]];
    }
    offsets_ = std::move(offsets);
  }
  // Returns the levels in the order of their depth.
  std::vector<PageBuffer<uint32_t>> finish() {
    std::ranges::reverse(levels_);
    return std::move(levels_);
  }

 private:
  PageBuffer<uint32_t>& add_level(uint64_t words) {
    if (words > UINT32_MAX) throw OutOfBudget();
    return levels_.emplace_back(budget_, words, filled_memory());
  }

  MemoryBudget& budget_;
  std::vector<PageBuffer<uint32_t>> levels_;
  PageBuffer<uint32_t> offsets_;  // word offsets of the nodes of the level that was added last
};

std::vector<PageBuffer<uint32_t>> filled_levels(const DagView& dag, uint32_t grid_levels,
                                                MemoryBudget& budget, const CancelToken& cancel) {
  PagePool pool;
  PooledMemory memory{budget, pool};
  const NodeLevels levels = LevelReader(dag, grid_levels, memory, cancel).read();
  const SpaceLabels labels(memory, levels, &cancel);
  // SpaceLabels labels the components of the empty space that touch a face of a node's cube. The
  // faces of the root's cube are the border of the grid. So all labeled components of the root are
  // outside.
  const std::vector<uint8_t> is_outside(labels.count(0, 0), 1);
  SubDagTables tables(memory, static_cast<int>(grid_levels));
  fill_enclosed(memory, labels, is_outside, tables, &cancel);
  WordLevels words(budget);
  emit_levels(tables, {0, grid_levels, 64}, words);
  return words.finish();
}

}  // namespace

FilledDag::FilledDag(const DagView& dag, uint32_t grid_levels, const std::string& path,
                     MemoryBudget& budget, const CancelToken& cancel) {
  try {
    levels_ = filled_levels(dag, grid_levels, budget, cancel);
  } catch (const OutOfBudget&) {
    throw Error(ErrorCode::kOutOfMemory,
                "out of memory: " + filled_memory() +
                    " does not fit in the memory budget: expected a larger budget (" +
                    option_text("memory") + ") or a coarser " + option_text("level"));
  }
  std::vector<DagView::Level> views;
  for (const PageBuffer<uint32_t>& level : levels_)
    views.push_back({{level.data(), level.size()}, false});
  view_.emplace(std::move(views), grid_levels, path);
}

}  // namespace voxdag::query
