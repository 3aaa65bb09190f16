#include "core/format/verify/verify_nodes.h"

#include <algorithm>
#include <atomic>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/base/parallel_for.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/node_index.h"
#include "core/format/verify/node_batch.h"
#include "core/format/verify/subtree_table.h"
#include "core/format/verify/verify_order.h"

namespace voxdag {

using namespace global_layout;

namespace {

constexpr uint64_t kNodesPerItem = uint64_t{1} << 16;

// A level with its index and the values of its nodes.
struct CheckedLevel {
  uint32_t level = 0;
  NodeIndex index;
  SubtreeTable table;
};

class NodeVerifier {
 public:
  NodeVerifier(const voxdag_reader::File& file, unsigned threads, MemoryBudget& budget,
               Progress& progress, const CancelToken& cancel, bool is_quick, PageLimit& pages)
      : file_(file),
        threads_(threads),
        budget_(budget),
        progress_(progress),
        cancel_(cancel),
        is_quick_(is_quick),
        pages_(pages),
        orphans_(file.brick_level() + 1, NodeIndex::kNone) {}

  // Returns the values of the root.
  Subtree check_levels();

 private:
  class OrderCheck;

  [[noreturn]] void broken(const std::string& where, const std::string& what) const {
    throw Error(ErrorCode::kCorrupt, where + ": " + what);
  }
  std::string where(uint32_t level) const {
    return file_.path() + ": level " + std::to_string(level);
  }
  std::string where(uint32_t level, uint64_t word) const {
    return where(level) + ", word " + std::to_string(word);
  }
  bool is_by_hash() const { return NodeOrder{file_.node_order()} == NodeOrder::kByHash; }
  Pointers pointers(uint32_t level) const {
    if (level == file_.brick_level()) return Pointers::kNone;
    return file_.level(level + 1).pointer_bits == 64 ? Pointers::kWide : Pointers::kNarrow;
  }

  void check_level(uint32_t level);
  uint64_t check_bricks(CheckedLevel& bricks, uint64_t span) const;
  uint64_t check_nodes(CheckedLevel& nodes, uint64_t span);
  NodeLevel node_level(uint32_t level);
  void expect_children(uint32_t level, const NodeBatch& batch) const;
  uint64_t first_orphan() const;

  const voxdag_reader::File& file_;
  const unsigned threads_;
  MemoryBudget& budget_;
  Progress& progress_;
  const CancelToken& cancel_;
  const bool is_quick_;
  PageLimit& pages_;
  const ComputeBatch compute_batch_ = compute_batch();
  CheckedLevel below_;             // the level checked last
  std::vector<uint64_t> orphans_;  // index of each level's first node without a parent, or kNone
};

// Checks that nodes are in the order by hash. If the file has another order, accepts all nodes.
class NodeVerifier::OrderCheck {
 public:
  // `previous` is the word offset of the node before the first one, or kNone.
  OrderCheck(const NodeVerifier& verifier, uint32_t level, uint64_t previous, uint64_t hash)
      : verifier_(verifier), level_(level), previous_(previous), previous_hash_(hash) {}

  // Passes the next node: the word offset at which it begins, and its hash.
  void pass(uint64_t at, uint64_t hash) {
    if (hash <= previous_hash_ && previous_ != NodeIndex::kNone && verifier_.is_by_hash())
      expect_after_previous(at, hash);
    previous_ = at;
    previous_hash_ = hash;
  }

 private:
  void expect_after_previous(uint64_t at, uint64_t hash) const {
    if (hash == previous_hash_ && is_node_less(verifier_.file_, level_, previous_, at)) return;
    verifier_.broken(verifier_.where(level_, at),
                     level_ == verifier_.file_.brick_level()
                         ? "the brick does not follow the one before it by hash and mask"
                         : "the node does not follow the one before it in the total order of "
                           "nodes (docs/format.md)");
  }

  const NodeVerifier& verifier_;
  const uint32_t level_;
  uint64_t previous_;
  uint64_t previous_hash_;
};

// Checks the bricks in a span, and computes their values. The first brick is compared with the last
// one before the span. Returns the number of bricks.
uint64_t NodeVerifier::check_bricks(CheckedLevel& bricks, uint64_t span) const {
  const auto hash_at = [&](uint64_t at) {
    return truncate_hash(hash_brick(file_.brick(at)), file_.hash_bits());
  };
  const uint64_t previous = span == 0 ? NodeIndex::kNone : bricks.index.last_before(span);
  OrderCheck order(*this, bricks.level, previous, span == 0 ? 0 : hash_at(previous));
  uint64_t count = 0;
  bricks.index.visit_span(span, [&](uint64_t i, uint64_t at) {
    const uint64_t brick = file_.brick(at);
    if (brick == 0)
      broken(where(bricks.level, at), "the brick is empty: expected at least one voxel");
    const uint64_t hash = hash_at(at);
    order.pass(at, hash);
    bricks.table.set(i, {hash, static_cast<uint64_t>(popcount64(brick)), 1});
    ++count;
  });
  return count;
}

NodeLevel NodeVerifier::node_level(uint32_t level) {
  return {file_.level(level), file_.hash_bits(), pointers(level) == Pointers::kWide,
          below_.index.lookup(), below_.table.words()};
}

// Throws Error if one of the batch's pointers does not lead to a node.
void NodeVerifier::expect_children(uint32_t level, const NodeBatch& batch) const {
  if (batch.valid == batch.count) return;
  const uint64_t at = batch.at[batch.valid];
  const voxdag_reader::Node node = verified_node(file_, level, at);
  broken(where(level, at + 1 + (static_cast<uint64_t>(batch.broken_child) << node.wide)),
         "a child at word " + std::to_string(node.child(batch.broken_child)) +
             ", where no node of level " + std::to_string(level + 1) + " begins");
}

// Checks the nodes in a span, and computes their values. The first node is compared with the last
// one before the span. The values of that node are computed again, because another thread may be
// checking its span. Returns the number of nodes.
uint64_t NodeVerifier::check_nodes(CheckedLevel& nodes, uint64_t span) {
  const NodeLevel level = node_level(nodes.level);
  NodeBatch batch;
  OrderCheck order(*this, nodes.level, NodeIndex::kNone, 0);
  if (span > 0) {
    batch.at[batch.count++] = nodes.index.last_before(span);
    compute_batch_(level, batch);
    expect_children(nodes.level, batch);
    order.pass(batch.at[0], batch.subtrees[0].hash);
    batch.count = 0;
  }
  uint64_t first = 0, count = 0;
  const auto finish_batch = [&] {
    compute_batch_(level, batch);
    for (uint32_t i = 0; i < batch.valid; ++i) {
      order.pass(batch.at[i], batch.subtrees[i].hash);
      nodes.table.set(first + i, batch.subtrees[i]);
    }
    expect_children(nodes.level, batch);
    count += batch.count;
    batch.count = 0;
  };
  nodes.index.visit_span(span, [&](uint64_t i, uint64_t at) {
    if (batch.count == 0) first = i;
    batch.at[batch.count++] = at;
    if (batch.count == NodeBatch::kNodes) finish_batch();
  });
  finish_batch();
  return count;
}

// Returns the index of the first node of `below_` without a parent; kNone if all have parents.
uint64_t NodeVerifier::first_orphan() const {
  const SubtreeTable& table = below_.table;
  std::atomic<uint64_t> first = NodeIndex::kNone;
  const uint64_t items = (table.size() + kNodesPerItem - 1) / kNodesPerItem;
  parallel_for(threads_, items, [&](unsigned, size_t item) {
    cancel_.check();
    const uint64_t end = std::min(table.size(), (item + 1) * kNodesPerItem);
    uint64_t i = item * kNodesPerItem;
    while (i < end && table.has_parent(i)) ++i;
    uint64_t known = first.load();
    while (i < end && i < known && !first.compare_exchange_weak(known, i)) {
    }
  });
  return first;
}

void NodeVerifier::check_level(uint32_t level) {
  const voxdag_reader::Level& words = file_.level(level);
  CheckedLevel checked{
      level, NodeIndex(words, pointers(level), threads_, budget_, cancel_, where(level), &pages_),
      SubtreeTable(budget_, words.node_count, file_.grid_levels() - level)};
  parallel_for(threads_, checked.index.span_count(), [&](unsigned, size_t span) {
    cancel_.check();
    const bool are_bricks = level == file_.brick_level();
    progress_.advance(are_bricks ? check_bricks(checked, span) : check_nodes(checked, span));
    pages_.touch(sizeof(uint32_t) * NodeIndex::kSpanWords);
  });
  if (!is_by_hash()) {
    if (level < file_.brick_level())
      expect_first_parents(file_, level, checked.index, cancel_, pages_);
    if (!is_quick_)
      expect_unique({file_, level, checked.index, checked.table}, threads_, budget_, cancel_);
  }
  if (level < file_.brick_level()) orphans_[level + 1] = first_orphan();
  below_ = std::move(checked);
}

Subtree NodeVerifier::check_levels() {
  progress_.begin_stage("verify nodes", file_.dag_nodes(), "nodes");
  for (uint32_t level = file_.brick_level() + 1; level-- > 0;) check_level(level);
  if (file_.level(0).node_count != 1)
    broken(where(0), std::to_string(file_.level(0).node_count) + " roots, expected 1");
  progress_.end_stage();
  for (uint32_t level = 0; level <= file_.brick_level(); ++level)
    if (orphans_[level] != NodeIndex::kNone)
      broken(where(level),
             "node " + std::to_string(orphans_[level]) + " has no parent: expected at least one");
  return below_.table.at(0);
}

}  // namespace

void verify_nodes(const voxdag_reader::File& file, unsigned threads, MemoryBudget& budget,
                  Progress& progress, const CancelToken& cancel, bool is_quick, PageLimit& pages) {
  Subtree root;
  if (!file.empty())
    root = NodeVerifier(file, threads, budget, progress, cancel, is_quick, pages).check_levels();
  const std::string header = file.path() + ": header: ";
  if (root.voxels != file.voxels())
    throw Error(ErrorCode::kCorrupt, header + std::to_string(file.voxels()) +
                                         " voxels, the DAG has " + std::to_string(root.voxels));
  if (root.svo_nodes != file.svo_nodes())
    throw Error(ErrorCode::kCorrupt, header + std::to_string(file.svo_nodes()) +
                                         " octree nodes, the DAG has " +
                                         std::to_string(root.svo_nodes));
}

}  // namespace voxdag
