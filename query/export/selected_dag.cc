#include "query/export/selected_dag.h"

#include <algorithm>
#include <bit>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "query/lookup/bricks.h"

namespace voxdag::query {
namespace {

constexpr uint64_t kNoOffset = ~uint64_t{0};
std::string dag_memory() { return "the DAG of the selection (" + less_is_needed() + ")"; }

uint64_t mix_bits(uint64_t x) {
  x = (x ^ x >> 32) * 0x9e3779b97f4a7c15u;
  x = (x ^ x >> 29) * 0xbf58476d1ce4e5b9u;
  return x ^ x >> 32;
}

// An open-addressing hash table. `Slot` must have a member `hash` and a function `free()`.
template <class Slot>
class SlotTable {
 public:
  explicit SlotTable(MemoryBudget& budget) : budget_(budget) {}
  // Returns the slot with this hash for which is_it(slot) is true. If no slot matches, returns a
  // free slot, which the caller must fill, and which already counts as used.
  template <class IsIt>
  Slot& find(uint64_t hash, const IsIt& is_it) {
    if (4 * (used_ + 1) > 3 * slots_.size()) grow();
    Slot& slot = *probe(hash, is_it);
    used_ += slot.free();
    return slot;
  }

 private:
  template <class IsIt>
  Slot* probe(uint64_t hash, const IsIt& is_it) {
    for (uint64_t at = hash;; ++at) {
      Slot& slot = slots_[at & (slots_.size() - 1)];
      if (slot.free() || (slot.hash == hash && is_it(slot))) return &slot;
    }
  }
  void grow() {
    const size_t count = std::max<size_t>(64, 2 * slots_.size());
    MemoryCharge charge(budget_, count * sizeof(Slot), dag_memory());
    std::vector<Slot> old(count);
    old.swap(slots_);
    for (const Slot& slot : old)
      if (!slot.free()) *probe(slot.hash, [](const Slot&) { return false; }) = slot;
    charge_ = std::move(charge);
  }

  MemoryBudget& budget_;
  std::vector<Slot> slots_;
  MemoryCharge charge_;
  uint64_t used_ = 0;
};

struct NodeSlot {
  uint64_t hash = 0;
  uint64_t offset = kNoOffset;
  bool free() const { return offset == kNoOffset; }
};

struct MemoSlot {
  uint64_t hash = 0;            // bijective hash of `source`
  uint64_t source = 0;          // word offset of the file's node in its level
  uint64_t offset = kNoOffset;  // word offset of the new node in its level
  uint64_t voxels = 0;          // voxels below the new node
  bool free() const { return offset == kNoOffset; }
};

// One level of the new DAG.
class BuiltLevel {
 public:
  explicit BuiltLevel(MemoryBudget& budget) : budget_(budget), table_(budget) {}
  // Returns the offset of a node that equals `node`. Adds such a node if none exists.
  uint64_t offset_of(std::span<const uint32_t> node) {
    uint64_t hash = node.size();
    for (const uint32_t word : node) hash = mix_bits(hash ^ word) + word;
    NodeSlot& slot = table_.find(hash, [&](const NodeSlot& other) {
      return words_.size() - other.offset >= node.size() &&
             std::equal(node.begin(), node.end(),
                        words_.begin() + static_cast<ptrdiff_t>(other.offset));
    });
    if (slot.free()) {
      reserve(node.size());
      slot = {hash, words_.size()};
      words_.insert(words_.end(), node.begin(), node.end());
      ++nodes_;
    }
    return slot.offset;
  }
  std::span<const uint32_t> words() const { return words_; }
  uint64_t nodes() const { return nodes_; }

 private:
  void reserve(size_t more) {
    if (words_.size() + more <= words_.capacity()) return;
    const size_t count = std::max<size_t>(256, words_.capacity() + words_.capacity() / 2);
    if (count > uint64_t{1} << 32)
      throw Error(ErrorCode::kLimit,
                  "the DAG of the selection has a level of over 2^32 words: expected a smaller " +
                      option_text("region") + " or a coarser " + option_text("level"));
    MemoryCharge charge(budget_, count * sizeof(uint32_t), dag_memory());
    words_.reserve(count);
    charge_ = std::move(charge);
  }

  MemoryBudget& budget_;
  SlotTable<NodeSlot> table_;
  std::vector<uint32_t> words_;
  MemoryCharge charge_;
  uint64_t nodes_ = 0;
};

struct BuiltNode {
  uint64_t offset = kNoOffset;
  uint64_t voxels = 0;
};

// Builds the DAG of the selected cells, depth first. A node is added after its children.
class DagBuilder {
 public:
  explicit DagBuilder(const ExportJob& job) : job_(job), stage_(job, "select", 0, "nodes") {
    for (uint32_t level = 0; level + 1 < job.selection.grid_levels; ++level) {
      levels_.emplace_back(job.budget);
      memo_.emplace_back(job.budget);
    }
  }
  BuiltNode run() { return build(0, job_.dag.root(), {0, 0, 0}); }
  std::vector<BuiltLevel>& levels() { return levels_; }

 private:
  BuiltNode build(uint32_t depth, uint64_t content, const Position& corner) {
    const int64_t edge = int64_t{1} << (job_.selection.grid_levels - depth);
    if (!job_.selection.region.intersects(corner, edge)) return {};
    // Results are remembered only for nodes completely inside the region: a node that the region
    // cuts can give a different result at each place. Bricks of the file are not remembered:
    // `content` is their mask, not an offset, and building a brick again costs no more than finding
    // it.
    const bool is_brick = depth + kBrickLevels == job_.dag.grid_levels();
    if (is_brick || !job_.selection.region.contains(corner, edge))
      return build_node(depth, content, corner, edge);
    const uint64_t hash = mix_bits(content);
    const auto is_it = [&](const MemoSlot& slot) { return slot.source == content; };
    MemoSlot& known = memo_[depth].find(hash, is_it);
    if (!known.free()) return {known.offset, known.voxels};
    // `known` remains valid while the node is built: a node never contains another node of its own
    // depth, so the build does not change the table of this depth.
    const BuiltNode built = build_node(depth, content, corner, edge);
    known = {hash, content, built.offset, built.voxels};
    return built;
  }

  BuiltNode build_node(uint32_t depth, uint64_t content, const Position& corner, int64_t edge) {
    if (edge == kBrickEdge) {
      const uint64_t mask =
          brick_of_cells(job_.dag, depth, content) & mask_within(job_.selection.region, corner);
      if (mask == 0) return {};
      const uint32_t words[] = {static_cast<uint32_t>(mask), static_cast<uint32_t>(mask >> 32)};
      return {levels_[depth].offset_of(words), static_cast<uint64_t>(std::popcount(mask))};
    }
    stage_.advance(1);
    const DagView::Children children = job_.dag.children(depth, content);
    std::array<uint32_t, 9> words{};
    size_t count = 1;
    BuiltNode node;
    for (int i = 0; i < 8; ++i) {
      if (!children.has(i)) continue;
      const BuiltNode child =
          build(depth + 1, job_.dag.content(depth, children, i), child_corner(corner, i, edge / 2));
      if (child.offset == kNoOffset) continue;
      words[0] |= 1u << i;
      words[count++] = static_cast<uint32_t>(child.offset);
      node.voxels += child.voxels;
    }
    if (count == 1) return {};
    node.offset = levels_[depth].offset_of(std::span(words).first(count));
    return node;
  }

  const ExportJob& job_;
  ExportStage stage_;
  std::vector<BuiltLevel> levels_;
  std::vector<SlotTable<MemoSlot>> memo_;
};

bool has_wide_levels(const voxdag_reader::File& file) {
  for (uint32_t level = 0; level <= file.brick_level(); ++level)
    if (file.level(level).pointer_bits == 64) return true;
  return false;
}

}  // namespace

struct SelectedDag::Built {
  std::vector<BuiltLevel> levels;
};

SelectedDag::SelectedDag(const ExportJob& job)
    : grid_levels_(job.selection.grid_levels), path_(job.file.path()) {
  if (job.selects_all_of(job.dag.grid_levels()) && !has_wide_levels(job.file)) {
    voxels_ = job.file.voxels();
    for (uint32_t level = 0; level <= brick_level(); ++level) {
      words_.push_back(job.dag.level(level).words);
      nodes_.push_back(job.file.level(level).node_count);
    }
    return;
  }
  DagBuilder builder(job);
  voxels_ = builder.run().voxels;
  if (voxels_ == 0) refuse_empty(job);
  built_ = std::make_unique<Built>(Built{std::move(builder.levels())});
  for (const BuiltLevel& level : built_->levels) {
    words_.push_back(level.words());
    nodes_.push_back(level.nodes());
  }
}

SelectedDag::~SelectedDag() = default;

uint64_t SelectedDag::node_count() const {
  uint64_t count = 0;
  for (const uint64_t nodes : nodes_) count += nodes;
  return count;
}

uint64_t SelectedDag::word_count() const {
  uint64_t count = 0;
  for (const auto words : words_) count += words.size();
  return count;
}

DagView SelectedDag::view() const {
  std::vector<DagView::Level> levels;
  for (const auto words : words_) levels.push_back({words, false});
  return DagView(std::move(levels), grid_levels_, path_);
}

SelectedDag::Size SelectedDag::size_at(uint32_t grid_levels) const {
  Size size;
  for (uint32_t level = 0; level + kBrickLevels < grid_levels; ++level) {
    size.words += words_[level].size();
    size.nodes += nodes_[level];
  }
  size.bricks = nodes_[grid_levels - kBrickLevels];
  size.words += 2 * size.bricks;
  return size;
}

}  // namespace voxdag::query
