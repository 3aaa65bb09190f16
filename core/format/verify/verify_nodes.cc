#include "core/format/verify/verify_nodes.h"

#include <algorithm>
#include <atomic>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/base/parallel_for.h"
#include "core/format/global/global_layout.h"
#include "core/format/verify/checked_level.h"
#include "core/format/verify/child_values.h"
#include "core/format/verify/node_batch.h"
#include "core/format/verify/subtree_table.h"
#include "core/format/verify/verify_order.h"

namespace voxdag {

using namespace global_layout;

namespace {

constexpr uint64_t kNodesPerItem = uint64_t{1} << 16;

class NodeVerifier {
 public:
  explicit NodeVerifier(const VerifyTask& task)
      : task_(task),
        file_(task.file),
        total_(file_.dag_nodes()),
        orphans_(file_.brick_level() + 1, NodeIndex::kNone) {}

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
  bool fits_in_memory(uint32_t level) const;
  void load(CheckedLevel& stored) const;
  CheckedLevel index_level(uint32_t level) const;
  void check_in_memory(CheckedLevel& checked);
  void check_stored(CheckedLevel& checked, const ChildValues* children);
  uint64_t check_bricks(const CheckedLevel& bricks, uint64_t span, SubtreeTable& values) const;
  uint64_t check_nodes(const CheckedLevel& nodes, uint64_t span, NodeLevel level,
                       SubtreeTable& values) const;
  NodeLevel node_level();
  void expect_children(uint32_t level, const NodeBatch& batch) const;

  const VerifyTask& task_;
  const voxdag_reader::File& file_;
  const ComputeBatch compute_batch_ = compute_batch();
  CheckedLevel below_;  // the level checked last
  // Total of the progress: all nodes once, and the nodes of two levels again if the lower level is
  // stored.
  uint64_t total_;
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

// Checks the bricks in a span, and computes their values. `values` has the values of the level or,
// if the level is stored, of the span. The first brick is compared with the last one before the
// span. Returns the number of bricks.
uint64_t NodeVerifier::check_bricks(const CheckedLevel& bricks, uint64_t span,
                                    SubtreeTable& values) const {
  const auto hash_at = [&](uint64_t at) {
    return truncate_hash(hash_brick(file_.brick(at)), file_.hash_bits());
  };
  const uint64_t previous = span == 0 ? NodeIndex::kNone : bricks.last_before(span);
  OrderCheck order(*this, bricks.level, previous, span == 0 ? 0 : hash_at(previous));
  const uint64_t begin = bricks.is_stored() ? bricks.spans.nodes_before(span) : 0;
  uint64_t count = 0;
  bricks.visit_span(span, [&](uint64_t i, uint64_t at) {
    const uint64_t brick = file_.brick(at);
    if (brick == 0)
      broken(where(bricks.level, at), "the brick is empty: expected at least one voxel");
    const uint64_t hash = hash_at(at);
    order.pass(at, hash);
    values.set(i - begin, {hash, static_cast<uint64_t>(popcount64(brick)), 1});
    ++count;
  });
  return count;
}

// Returns the lookups of the children in `below_`, which must be in memory.
NodeLevel NodeVerifier::node_level() {
  NodeLevel level;
  level.below = below_.index.lookup();
  level.children = below_.table.words();
  return level;
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

// Checks the nodes in a span, and computes their values. `level` finds the children. `values` has
// the values of the level or, if the level is stored, of the span. The first node is compared with
// the last one before the span. The values of that node are computed again, because another thread
// may be checking its span. Returns the number of nodes.
uint64_t NodeVerifier::check_nodes(const CheckedLevel& nodes, uint64_t span, NodeLevel level,
                                   SubtreeTable& values) const {
  level.nodes = file_.level(nodes.level);
  level.hash_bits = file_.hash_bits();
  level.is_wide = pointers(nodes.level) == Pointers::kWide;
  NodeBatch batch;
  OrderCheck order(*this, nodes.level, NodeIndex::kNone, 0);
  if (span > 0) {
    batch.at[batch.count++] = nodes.last_before(span);
    compute_batch_(level, batch);
    expect_children(nodes.level, batch);
    order.pass(batch.at[0], batch.subtrees[0].hash);
    batch.count = 0;
  }
  const uint64_t begin = nodes.is_stored() ? nodes.spans.nodes_before(span) : 0;
  uint64_t first = 0, count = 0;
  const auto finish_batch = [&] {
    compute_batch_(level, batch);
    for (uint32_t i = 0; i < batch.valid; ++i) {
      order.pass(batch.at[i], batch.subtrees[i].hash);
      values.set(first + i, batch.subtrees[i]);
    }
    expect_children(nodes.level, batch);
    count += batch.count;
    batch.count = 0;
  };
  nodes.visit_span(span, [&](uint64_t i, uint64_t at) {
    if (batch.count == 0) first = i - begin;
    batch.at[batch.count++] = at;
    if (batch.count == NodeBatch::kNodes) finish_batch();
  });
  finish_batch();
  return count;
}

void NodeVerifier::check_in_memory(CheckedLevel& checked) {
  parallel_for(task_.threads, checked.span_count(), [&](unsigned, size_t span) {
    task_.cancel.check();
    task_.progress.advance(checked.level == file_.brick_level()
                               ? check_bricks(checked, span, checked.table)
                               : check_nodes(checked, span, node_level(), checked.table));
    task_.pages.touch(sizeof(uint32_t) * NodeIndex::kSpanWords);
  });
}

// `children` finds the children. If it is null, they are in memory.
void NodeVerifier::check_stored(CheckedLevel& checked, const ChildValues* children) {
  struct Worker {
    SubtreeTable values;
    ChildValues::Buffer buffer;
  };
  const uint64_t span_words = checked.spans.span_words();
  const unsigned threads = task_.threads_for_scratch();
  std::vector<Worker> workers(threads);
  for (Worker& worker : workers)
    worker.values = SubtreeTable(task_.budget, span_words / 2 + 1, checked.cube_levels);
  parallel_for(threads, checked.span_count(), [&](unsigned number, size_t span) {
    task_.cancel.check();
    auto& [values, buffer] = workers[number];
    const uint64_t nodes =
        checked.level == file_.brick_level()
            ? check_bricks(checked, span, values)
            : check_nodes(checked, span, children ? children->load(span, buffer) : node_level(),
                          values);
    const std::span<const uint32_t> words = values.words_of(0, nodes);
    checked.values->reserve(span, words.size());
    checked.values->append(span, words);
    task_.progress.advance(nodes);
    task_.pages.touch(sizeof(uint32_t) * span_words);
  });
}

// True if the index and the table of a level fit in three quarters of the free memory.
bool NodeVerifier::fits_in_memory(uint32_t level) const {
  const voxdag_reader::Level& words = file_.level(level);
  return LevelWindow::bytes(level == file_.brick_level(), file_.grid_levels() - level,
                            words.word_count, words.node_count) <= task_.free_memory() / 4 * 3;
}

// Loads a stored level into memory.
void NodeVerifier::load(CheckedLevel& stored) const {
  LevelWindow window(task_, task_.threads, stored, 0, stored.spans.size());
  stored.index = std::move(window.index);
  stored.table = std::move(window.table);
  stored.values.reset();
}

// Finds the nodes of a level. Throws Error{kNoSpace} if the level must be stored, and its temporary
// files do not fit on the disk.
CheckedLevel NodeVerifier::index_level(uint32_t level) const {
  const voxdag_reader::Level& words = file_.level(level);
  CheckedLevel checked;
  checked.level = level;
  checked.cube_levels = file_.grid_levels() - level;
  if (!below_.is_stored() && fits_in_memory(level)) {
    checked.index = NodeIndex(words, pointers(level), task_.threads, task_.budget, task_.cancel,
                              where(level), &task_.pages);
    checked.table = SubtreeTable(task_.budget, words.node_count, checked.cube_levels);
    return checked;
  }
  VerifyScratch& scratch = *task_.scratch;
  checked.spans = NodeSpans(words, pointers(level), task_.threads, task_.budget, task_.cancel,
                            where(level), &task_.pages, scratch.span_words);
  checked.values = std::make_unique<SpanFile>(scratch, task_.budget, checked.spans.size());
  uint64_t scratch_words = words.node_count * SubtreeTable::node_words(checked.cube_levels);
  if (below_.is_stored()) scratch_words += ChildValues::scratch_words(checked.spans, below_);
  scratch.require_space(scratch_words * sizeof(uint32_t), where(level));
  return checked;
}

void NodeVerifier::check_level(uint32_t level) {
  if (below_.is_stored() && fits_in_memory(below_.level)) load(below_);
  CheckedLevel checked = index_level(level);
  uint64_t orphan = NodeIndex::kNone;
  if (below_.is_stored()) {
    task_.progress.set_total(total_ +=
                             file_.level(level).node_count + file_.level(level + 1).node_count);
    const ChildValues children(task_, checked.spans, below_, task_.free_memory() / 4 * 3);
    orphan = children.first_orphan();
    check_stored(checked, &children);
  } else {
    if (checked.is_stored())
      check_stored(checked, nullptr);
    else
      check_in_memory(checked);
    if (level < file_.brick_level()) orphan = first_orphan(task_, below_.table);
  }
  if (!is_by_hash()) {
    if (level < file_.brick_level()) expect_first_parents(task_, checked);
    if (checked.is_stored()) below_ = {};
    if (!task_.is_quick) expect_unique(task_, checked);
  }
  if (level < file_.brick_level()) orphans_[level + 1] = orphan;
  below_ = std::move(checked);
}

Subtree NodeVerifier::check_levels() {
  task_.progress.begin_stage("verify nodes", total_, "nodes");
  for (uint32_t level = file_.brick_level() + 1; level-- > 0;) check_level(level);
  if (file_.level(0).node_count != 1)
    broken(where(0), std::to_string(file_.level(0).node_count) + " roots, expected 1");
  task_.progress.end_stage();
  for (uint32_t level = 0; level <= file_.brick_level(); ++level)
    if (orphans_[level] != NodeIndex::kNone)
      broken(where(level),
             "node " + std::to_string(orphans_[level]) + " has no parent: expected at least one");
  if (below_.is_stored()) load(below_);
  return below_.table.at(0);
}

}  // namespace

uint64_t first_orphan(const VerifyTask& task, const SubtreeTable& table) {
  std::atomic<uint64_t> first = NodeIndex::kNone;
  const uint64_t items = (table.size() + kNodesPerItem - 1) / kNodesPerItem;
  parallel_for(task.threads, items, [&](unsigned, size_t item) {
    task.cancel.check();
    const uint64_t end = std::min(table.size(), (item + 1) * kNodesPerItem);
    uint64_t i = item * kNodesPerItem;
    while (i < end && table.has_parent(i)) ++i;
    uint64_t known = first.load();
    while (i < end && i < known && !first.compare_exchange_weak(known, i)) {
    }
  });
  return first;
}

void verify_nodes(const VerifyTask& task) {
  const voxdag_reader::File& file = task.file;
  Subtree root;
  if (!file.empty()) root = NodeVerifier(task).check_levels();
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
