#include "query/extract/majority_cells.h"

#include <algorithm>
#include <bit>
#include <memory>
#include <optional>

#include "core/base/popcount8.h"
#include "query/combine/spill/node_values.h"
#include "query/dag/dag_input.h"
#include "query/dag/dag_view.h"

namespace voxdag::query {
namespace {

// The free memory divided by these numbers limits three parts: the voxel counts of one level (two
// levels are in memory at any time), a window of lookups, and a list of SpillSpace
// (query/combine/spill/node_values.h, spill.h).
constexpr uint64_t kCountShare = 4;
constexpr uint64_t kCountWindowShare = 32;
constexpr uint64_t kCountListShare = 1024;
constexpr uint64_t kMaxCountListBytes = uint64_t{1} << 20;
constexpr uint64_t kCountBufferBytes = uint64_t{16} << 10;

// For each node of a level, the number of voxels below it.
using VoxelNumbers = NodeValues<uint64_t>;
using VoxelLookups = NodeLookups<VoxelNumbers>;

// Visits the nodes of a level in the order of the file, and computes the number of voxels below
// each.
class VoxelCursor {
 public:
  // `below` has the numbers of voxels below the nodes of the next finer level; it is null for
  // bricks.
  VoxelCursor(DagInput& input, uint32_t level, const VoxelNumbers* below, const SpillSpace& space,
              uint64_t window_bytes)
      : input_(input), level_(level), cursor_(input, level) {
    if (!below) return;
    lookups_.emplace(*below, space, window_bytes);
    announce();
  }

  bool at_end() const { return cursor_.at_end(); }
  uint64_t offset() const { return cursor_.offset(); }
  // Returns the number of voxels below the current node. Must be called exactly once per node,
  // because the lookups are sequential.
  uint64_t voxels() {
    if (!lookups_) return static_cast<uint64_t>(popcount64(cursor_.brick()));
    lookups_->visit(cursor_);
    const voxdag_reader::Node& node = cursor_.node();
    uint64_t sum = 0;
    for (int i = 0; i < kPopcount8[node.child_mask]; ++i) {
      const FoundValue<uint64_t> below = lookups_->next(node.child(i));
      if (!below.begins)
        input_.corrupt(level_, offset(), "a child is at a word where no node begins");
      sum += below.value;
    }
    return sum;
  }
  void next() { cursor_.next(); }

 private:
  void announce() {
    if (!lookups_->needs_announcement()) return;
    for (LevelCursor all(input_, level_); !all.at_end(); all.next())
      for (int i = 0; i < kPopcount8[all.node().child_mask]; ++i)
        lookups_->announce(all.node().child(i));
    lookups_->resolve();
  }

  DagInput& input_;
  const uint32_t level_;
  LevelCursor cursor_;
  std::optional<VoxelLookups> lookups_;
};

uint64_t bit_words(const voxdag_reader::File& file, uint32_t level) {
  return level <= file.brick_level() ? file.level(level).word_count / 128 + 1 : 0;
}

}  // namespace

MajorityCells::MajorityCells(const voxdag_reader::File& file, uint32_t grid_levels,
                             ScratchFolder& folder, MemoryBudget& budget, Progress& progress,
                             const CancelToken& cancel)
    : file_(file),
      level_(grid_levels),
      cell_voxels_(uint64_t{1} << 3 * (file.grid_levels() - grid_levels)),
      bits_(budget, bit_words(file, grid_levels), "the cells with a majority of voxels") {
  if (bits_.size() == 0 || file.empty()) return;
  const uint64_t free_bytes = budget.available();
  const SpillSpace space{folder, budget, std::min(free_bytes / kCountListShare, kMaxCountListBytes),
                         kMaxCountListBytes, kCountBufferBytes};
  DagInput input(file, budget.limit(), cancel);
  std::unique_ptr<VoxelNumbers> below;
  progress.begin_stage("count", file.brick_level() + 2 - level_, "levels");
  // Also reads the level above the cells, only to check that its pointers lead to nodes.
  for (uint32_t level = file.brick_level() + 1; level-- > level_ - 1;) {
    auto numbers =
        std::make_unique<VoxelNumbers>(space, file.level(level), free_bytes / kCountShare);
    VoxelCursor node(input, level, below.get(), space, free_bytes / kCountWindowShare);
    for (; !node.at_end(); node.next()) {
      const uint64_t voxels = node.voxels();
      if (level == level_) set_if_majority(node.offset(), voxels);
      if (level >= level_) numbers->add(node.offset(), voxels);
    }
    numbers->finish();
    below = std::move(numbers);
    progress.advance(1);
  }
  progress.end_stage();
  file.release_pages();  // extract() reads with read calls from here on
}

uint8_t MajorityCells::octants(uint64_t mask) {
  uint32_t set = 0;
  for (int c = 0; c < 8; ++c)
    if (kPopcount8[mask >> (8 * c) & 255] >= 4) set |= 1u << c;
  return static_cast<uint8_t>(set);
}

uint8_t MajorityCells::children(const voxdag_reader::Node& node) const {
  uint32_t set = 0;
  int next = 0;
  for (uint32_t left = node.child_mask; left != 0; left &= left - 1)
    if (is_set(node.child(next++))) set |= left & -left;
  return static_cast<uint8_t>(set);
}

bool MajorityCells::is_set(uint64_t offset) const {
  // The constructor has checked all pointers to this level, but another program can have changed
  // the file since then.
  if (offset / 128 >= bits_.size()) refuse_missing_node(file_.path(), level_, offset);
  return bits_[offset / 128] >> offset / 2 % 64 & 1;
}

}  // namespace voxdag::query
