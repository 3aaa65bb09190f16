#include "query/combine/level_writer.h"

#include <optional>
#include <utility>

#include "core/base/host_device.h"
#include "query/combine/node_values.h"

namespace voxdag::query {

// Where a kept node of an input file is in the new file.
struct KeptPlace {
  uint64_t tag = 0;  // make_tag() of its word offset in the new file
  OctreeCounts counts;
};

using KeptPlaces = NodeValues<KeptPlace>;

namespace {

// Visits the kept nodes of a level of a file, with their children's offsets in the new file.
class KeptCursor {
 public:
  // `below` has the kept nodes of the next finer level; null for bricks.
  KeptCursor(DagInput& input, uint32_t level, const KeptNodes& kept,
             const SpillList<uint64_t>& hashes, const KeptPlaces* below, const SpillSpace& space,
             uint64_t window_bytes)
      : input_(input), level_(level), kept_(kept), hashes_(hashes), bits_(kept.bits) {
    if (kept.bits.size() == 0) return;
    if (below) {
      lookups_.emplace(*below, space, window_bytes);
      below_ = below->is_resident() ? below : nullptr;
      announce();
    }
    cursor_.emplace(input, level);
    find();
  }

  bool at_end() const { return !cursor_ || cursor_->at_end(); }
  uint64_t offset() const { return cursor_->offset(); }
  const Row& row() const { return row_; }
  const OctreeCounts& counts() const { return counts_; }
  void next() {
    step();
    find();
  }

 private:
  // Walks through the bits of offsets that increase.
  class Bits {
   public:
    explicit Bits(const SpillList<uint64_t>& bits) : reader_(bits) {}
    bool has(uint64_t offset) {
      for (; word_ < offset / 128; ++word_) reader_.pop();
      return reader_.front() >> offset / 2 % 64 & 1;
    }

   private:
    SpillReader<uint64_t> reader_;
    uint64_t word_ = 0;
  };

  void announce() {
    if (!lookups_->needs_announcement()) return;
    Bits bits(kept_.bits);
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
  // Goes to the next kept node, unless the current node is kept.
  void find() {
    while (!cursor_->at_end() && !bits_.has(cursor_->offset())) step();
    if (!cursor_->at_end()) load();
  }
  void load() {
    row_.hash = hashes_.front();
    counts_ = {1, 0};
    if (!lookups_) {
      row_.count = 1;
      row_.children[0] = cursor_->brick();
      counts_.voxels = static_cast<uint64_t>(popcount64(cursor_->brick()));
      return;
    }
    const voxdag_reader::Node& node = cursor_->node();
    if (below_)
      for (const uint32_t word : cursor_->words_ahead()) __builtin_prefetch(below_->find(word));
    row_.mask = node.child_mask;
    row_.count = kPopcount8[node.child_mask];
    for (uint32_t i = 0; i < row_.count; ++i) {
      const uint64_t child = node.child(static_cast<int>(i));
      const KeptPlace placed = lookups_->next(child);
      if (!is_tag_of(placed.tag, child))
        input_.corrupt(level_, offset(), "a child is at a word where no node begins");
      row_.children[i] = number_of_tag(placed.tag);
      counts_ += placed.counts;
    }
  }

  DagInput& input_;
  const uint32_t level_;
  const KeptNodes& kept_;
  SpillReader<uint64_t> hashes_;
  Bits bits_;
  std::optional<NodeLookups<KeptPlace>> lookups_;
  const KeptPlaces* below_ = nullptr;  // only to prefetch
  std::optional<LevelCursor> cursor_;
  Row row_;
  OctreeCounts counts_;
};

// Appends rows to a level of the new file.
class RowWriter {
 public:
  RowWriter(GlobalFileWriter& out, bool wide, MemoryBudget& budget)
      : out_(out), wide_(wide), words_(budget, kBufferWords, "words of a level") {}

  uint64_t nodes() const { return nodes_; }
  uint64_t words() const { return written_ + count_; }
  // Returns the word offset of the row.
  uint64_t add(const Row& row) {
    if (count_ + kMaxRowWords > kBufferWords) flush();
    const uint64_t position = words();
    ++nodes_;
    if (row.mask == 0) {
      put_wide(row.children[0]);
      return position;
    }
    words_[count_++] = row.mask;
    for (uint32_t i = 0; i < row.count; ++i)
      if (wide_)
        put_wide(row.children[i]);
      else
        words_[count_++] = static_cast<uint32_t>(row.children[i]);
    return position;
  }
  void flush() {
    out_.checksum_words({words_.data(), count_});
    out_.write_words(written_, {words_.data(), count_});
    written_ += count_;
    count_ = 0;
  }

 private:
  static constexpr uint64_t kBufferWords = uint64_t{1} << 16;
  static constexpr uint64_t kMaxRowWords = 17;
  void put_wide(uint64_t number) {
    words_[count_++] = static_cast<uint32_t>(number);
    words_[count_++] = static_cast<uint32_t>(number >> 32);
  }

  GlobalFileWriter& out_;
  const bool wide_;
  PageBuffer<uint32_t> words_;
  uint64_t count_ = 0;    // words in the buffer
  uint64_t written_ = 0;  // words in the file
  uint64_t nodes_ = 0;
};

// Does nothing unless the cursor is at `row`, which was written as `node` of the new file. Then
// stores where the kept node now is, passes `node` to all places that use it, and advances the
// cursor.
void pass_kept(KeptCursor& cursor, const Row& row, const NewNode& node, KeptPlaces& placed,
               SpillSorter<NodeUse>& uses, SpillSorter<KeyedNode>& parents) {
  if (cursor.at_end() || compare_rows(cursor.row(), row) != 0) return;
  const uint64_t offset = cursor.offset();
  placed.add(offset, {make_tag(node.position, offset), node.counts});
  for (; !uses.at_end() && uses.front().offset == offset; uses.pop())
    parents.add({uses.front().place, node});
  cursor.next();
}

// For each place whose result is a pair, adds the result of this pair.
void add_pair_results(const SpillList<PairUse>& uses, SpillSorter<KeyedNode>& results,
                      SpillSorter<KeyedNode>& parents) {
  results.finish();
  results.begin();
  for (SpillReader use(uses); !use.at_end(); use.pop()) {
    while (!results.at_end() && results.front().key < use.front().pair) results.pop();
    if (results.at_end()) return;
    if (results.front().key == use.front().pair)
      parents.add({use.front().place, results.front().node});
  }
}

}  // namespace

struct LevelsWriter::Below {
  KeptPlaces a, b;
  uint64_t words = 0;
};

LevelsWriter::LevelsWriter(DagInput& a, DagInput& b, const SpillSpace& space,
                           const LookupMemory& memory, GlobalFileWriter& out)
    : a_(a), b_(b), space_(space), memory_(memory), out_(out) {}
LevelsWriter::~LevelsWriter() = default;

// Makes the rows of pairs from the results of their children.
void LevelsWriter::make_rows(SpillSorter<PairRow>& rows) {
  SpillSorter<KeyedNode>& children = *children_;
  children.finish();
  children.begin();
  while (!children.at_end()) {
    PairRow made;
    made.pair = pair_of(children.front().key);
    made.counts.nodes = 1;
    uint64_t hashes[8];
    for (; !children.at_end() && pair_of(children.front().key) == made.pair; children.pop()) {
      const auto& [place, child] = children.front();
      made.row.mask |= 1u << child_of(place);
      hashes[made.row.count] = child.hash;
      made.row.children[made.row.count++] = child.position;
      made.counts += child.counts;
    }
    made.row.hash = truncate_hash(
        hash_node(made.row.mask, static_cast<int>(made.row.count), hashes), a_.file().hash_bits());
    rows.add(made);
  }
  children_.reset();
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
  while (!rows.at_end() || !a.at_end() || !b.at_end()) {
    const Row* least = nullptr;
    const OctreeCounts* counts = nullptr;
    const auto consider = [&](const Row& row, const OctreeCounts& row_counts) {
      if (least && compare_rows(*least, row) <= 0) return;
      least = &row;
      counts = &row_counts;
    };
    if (!a.at_end()) consider(a.row(), a.counts());
    if (!b.at_end()) consider(b.row(), b.counts());
    if (!rows.at_end()) consider(rows.front().row, rows.front().counts);
    const Row row = *least;
    const NewNode node{writer.add(row), row.hash, *counts};
    counts_.octree = node.counts;
    pass_kept(a, row, node, done->a, pairs.kept_a.uses, *children_);
    pass_kept(b, row, node, done->b, pairs.kept_b.uses, *children_);
    for (; !rows.at_end() && compare_rows(rows.front().row, row) == 0; rows.pop())
      results.add({rows.front().pair, node});
  }
  writer.flush();
  out_.end_level({.nodes = writer.nodes(), .words = writer.words()});
  counts_.dag_nodes += writer.nodes();
  add_pair_results(pairs.uses, results, *children_);
  done->a.finish();
  done->b.finish();
  done->words = writer.words();
  below_ = std::move(done);
}

}  // namespace voxdag::query
