#include "query/combine/level_writer.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "query/combine/spill/kept_places.h"
#include "query/combine/spill/node_values.h"

namespace voxdag::query {
namespace {

// Visits the kept nodes of a level of an input file. Returns each as a Row (result_rows.h) with its
// children's offsets in the new file.
class KeptCursor {
 public:
  // `below` has the new offsets of the kept nodes of the next finer level; it is null for bricks.
  // `hashes` are the hashes of all nodes of the level.
  KeptCursor(DagInput& input, uint32_t level, const KeptNodes& kept,
             const SpillList<uint64_t>& hashes, const KeptPlaces* below, const SpillSpace& space,
             uint64_t window_bytes)
      : input_(input), level_(level), kept_(kept), hashes_(hashes), bits_(kept.bits) {
    if (kept.bits.size() == 0) return;
    if (below) {
      lookups_.emplace(*below, space, window_bytes);
      announce();
    }
    cursor_.emplace(input, level);
    find();
  }

  bool at_end() const { return !cursor_ || cursor_->at_end(); }
  uint64_t offset() const { return cursor_->offset(); }
  const Row& row() const { return row_; }
  // Returns the hash of the current row. At the end of the level, returns the maximum of uint64_t.
  uint64_t hash() const { return at_end() ? ~uint64_t{0} : row_.hash; }
  void next() {
    step();
    find();
  }

 private:
  void announce() {
    if (!lookups_->needs_announcement()) return;
    MarkReader bits(kept_.bits);
    for (LevelCursor all(input_, level_); !all.at_end(); all.next())
      if (bits.has(all.offset()))
        for (int i = 0; i < kPopcount8[all.node().child_mask]; ++i)
          lookups_->announce(all.node().child(i));
    lookups_->resolve();
  }
  void step() {
    cursor_->next();
    hashes_.pop();
  }
  // Moves to the next kept node, unless the current node is kept. Loads the row of the kept node.
  void find() {
    while (!cursor_->at_end() && !bits_.has(cursor_->offset())) step();
    if (!cursor_->at_end()) load();
  }
  void load() {
    row_.hash = hashes_.front();
    if (!lookups_) {
      row_.count = 1;
      row_.children[0] = cursor_->brick();
      return;
    }
    lookups_->visit(*cursor_);
    const voxdag_reader::Node& node = cursor_->node();
    row_.mask = node.child_mask;
    row_.count = kPopcount8[node.child_mask];
    for (uint32_t i = 0; i < row_.count; ++i)
      row_.children[i] = lookups_->next(node.child(static_cast<int>(i))).value;
  }

  DagInput& input_;
  const uint32_t level_;
  const KeptNodes& kept_;
  SpillReader<uint64_t> hashes_;
  MarkReader bits_;
  std::optional<NodeLookups<KeptPlaces>> lookups_;
  std::optional<LevelCursor> cursor_;
  Row row_;
};

// The kept nodes of a level of an input file, one of the sources of a new level. `placed` receives
// their offsets in the new file. `uses` has the places (result_rows.h) whose result is a kept node.
// `parents` receives the results of these places.
struct KeptSource {
  KeptCursor& cursor;
  KeptPlaces& placed;
  SpillSorter<NodeUse>& uses;
  SpillSorter<KeyedNode>& parents;

  // Stores the new offset of the current node, adds the node as the result of all places that use
  // it, and advances the cursor. `node` is the current node in the new file.
  void pass(const NewNode& node) {
    const uint64_t offset = cursor.offset();
    placed.add(offset, node.position);
    for (; !uses.at_end() && uses.front().offset == offset; uses.pop())
      parents.add({uses.front().place, node});
    cursor.next();
  }
  // Calls pass() if the current node is equal to `row`.
  void pass_equal(const Row& row, const NewNode& node) {
    if (!cursor.at_end() && compare_rows(cursor.row(), row) == 0) pass(node);
  }
  // Copies the nodes whose hashes are less than `hash`, the smallest hash of the other sources. No
  // other source can have an equal node, so the rows need not be compared.
  void copy_before(uint64_t hash, RowWriter& writer) {
    while (cursor.hash() < hash) pass({writer.add(cursor.row()), cursor.row().hash});
  }
};

// Writes a level: merges its three sources, which are the kept nodes of both files and the rows of
// pairs. Writes equal rows once. Adds the new node of each pair to `results`.
void merge_sources(KeptSource a, KeptSource b, SpillSorter<PairRow>& rows,
                   SpillSorter<KeyedNode>& results, RowWriter& writer) {
  const auto hash_of_rows = [&] { return rows.at_end() ? ~uint64_t{0} : rows.front().row.hash; };
  for (;;) {
    a.copy_before(std::min(b.cursor.hash(), hash_of_rows()), writer);
    b.copy_before(std::min(a.cursor.hash(), hash_of_rows()), writer);
    const Row* least = nullptr;
    const auto consider = [&](const Row& row) {
      if (!least || compare_rows(row, *least) < 0) least = &row;
    };
    if (!a.cursor.at_end()) consider(a.cursor.row());
    if (!b.cursor.at_end()) consider(b.cursor.row());
    if (!rows.at_end()) consider(rows.front().row);
    if (!least) return;
    const Row row = *least;
    const NewNode node{writer.add(row), row.hash};
    a.pass_equal(row, node);
    b.pass_equal(row, node);
    for (; !rows.at_end() && compare_rows(rows.front().row, row) == 0; rows.pop())
      results.add({rows.front().pair, node});
  }
}

}  // namespace

struct LevelsWriter::Below {
  KeptPlaces a, b;
  uint64_t words = 0;
};

LevelsWriter::LevelsWriter(DagInput& a, DagInput& b, const SpillSpace& space,
                           const LookupMemory& memory, CountLevels& counts, GlobalFileWriter& out)
    : a_(a), b_(b), space_(space), memory_(memory), counts_(counts), out_(out) {}
LevelsWriter::~LevelsWriter() = default;

// Makes the row of each pair of the level from the results of the pair's children, and frees these
// results.
void LevelsWriter::make_rows(SpillSorter<PairRow>& rows) {
  SpillSorter<KeyedNode>& children = *children_;
  children.finish();
  children.begin();
  while (!children.at_end()) {
    PairRow made;
    made.pair = pair_of(children.front().key);
    uint64_t hashes[8];
    for (; !children.at_end() && pair_of(children.front().key) == made.pair; children.pop()) {
      const auto& [place, child] = children.front();
      made.row.mask |= 1u << child_of(place);
      hashes[made.row.count] = child.hash;
      made.row.children[made.row.count++] = child.position;
    }
    made.row.hash = truncate_hash(
        hash_node(made.row.mask, static_cast<int>(made.row.count), hashes), a_.file().hash_bits());
    rows.add(made);
  }
  children_.reset();
}

// `results` has the results of this level's pairs. `uses` lists, for each pair, the places
// (result_rows.h) whose result is the result of the pair. Adds the result of each place to
// children_, and the change of the place's counts to counts_.
void LevelsWriter::add_pair_results(const SpillList<PairUse>& uses,
                                    SpillSorter<KeyedNode>& results) {
  results.finish();
  results.begin();
  for (SpillReader use(uses); !use.at_end(); use.pop()) {
    while (!results.at_end() && results.front().key < use.front().pair) results.pop();
    const bool has_node = !results.at_end() && results.front().key == use.front().pair;
    if (has_node) children_->add({use.front().place, results.front().node});
    counts_.add_pair(use.front(), has_node);
  }
}

void LevelsWriter::write_level(uint32_t level, const JoinedLevel& joined, PairLevel& pairs,
                               SpillSorter<PairRow>& rows) {
  if (children_) make_rows(rows);
  rows.finish();
  rows.begin();
  KeptCursor a(a_, level, pairs.kept_a, joined.hashes_a, below_ ? &below_->a : nullptr, space_,
               memory_.window_bytes);
  KeptCursor b(b_, level, pairs.kept_b, joined.hashes_b, below_ ? &below_->b : nullptr, space_,
               memory_.window_bytes);
  if (rows.at_end() && a.at_end() && b.at_end()) return;
  children_ = std::make_unique<SpillSorter<KeyedNode>>(space_);
  auto done = std::unique_ptr<Below>(new Below{{space_, a_.level(level), memory_.value_bytes},
                                               {space_, b_.level(level), memory_.value_bytes}});
  SpillSorter<KeyedNode> results(space_);
  pairs.kept_a.uses.begin();
  pairs.kept_b.uses.begin();
  out_.begin_level(level);
  RowWriter writer(out_, below_ && out_.is_wide(below_->words), space_.budget);
  merge_sources({a, done->a, pairs.kept_a.uses, *children_},
                {b, done->b, pairs.kept_b.uses, *children_}, rows, results, writer);
  writer.flush();
  out_.end_level({.nodes = writer.nodes(), .words = writer.words()});
  dag_nodes_ += writer.nodes();
  counts_.begin_level();
  add_pair_results(pairs.uses, results);
  counts_.add_nodes(level, pairs);
  done->a.finish();
  done->b.finish();
  done->words = writer.words();
  below_ = std::move(done);
}

}  // namespace voxdag::query
