#include "query/combine/join.h"

#include <memory>
#include <optional>
#include <type_traits>
#include <utility>

#include "query/combine/result_rows.h"
#include "query/combine/spill/node_values.h"

namespace voxdag::query {

// The hash of a node of the first file.
struct HashOfA {
  uint64_t hash = 0;
};
// The hash of a node of the second file. `number_in_a` is 1 plus the word offset of the equal node
// of the first file, or 0 if the first file has no such node.
struct HashOfB {
  uint64_t hash = 0;
  uint64_t number_in_a = 0;
};

namespace {

uint64_t number_in_a(const HashOfA&, uint64_t offset) { return offset + 1; }
uint64_t number_in_a(const HashOfB& node, uint64_t) { return node.number_in_a; }

// Visits the nodes of a level in the order of the file, and computes their hashes. `Hash` is
// HashOfA for the first file and HashOfB for the second.
template <class Hash>
class HashCursor {
 public:
  // `below` has the hashes of the nodes of the next finer level; it is null for bricks.
  // `full_below` is the offset of the node of that level in which all voxels are set.
  HashCursor(DagInput& input, uint32_t level, const NodeValues<Hash>* below, uint64_t full_below,
             const SpillSpace& space, uint64_t window_bytes)
      : input_(input), level_(level), full_below_(full_below), cursor_(input, level) {
    if (below) {
      lookups_.emplace(*below, space, window_bytes);
      announce();
    }
    load();
  }

  bool at_end() const { return cursor_.at_end(); }
  uint64_t offset() const { return cursor_.offset(); }
  uint64_t hash() const { return own().hash; }
  bool is_full() const { return is_full_; }
  // True if the first file has an equal node for each child of the current node. Otherwise the
  // first file cannot have a node equal to the current node.
  bool is_comparable() const { return is_comparable_; }
  // Returns the current node as a Row (result_rows.h) with the offsets that its children have in
  // the first file. Requires is_comparable().
  const Row& row() const { return kIsA ? own() : joined_; }
  void next() {
    has_previous_ = true;
    current_ ^= 1;
    cursor_.next();
    load();
  }

 private:
  static constexpr bool kIsA = std::is_same_v<Hash, HashOfA>;

  const Row& own() const { return rows_[current_]; }
  void announce() {
    if (!lookups_->needs_announcement()) return;
    for (LevelCursor all(input_, level_); !all.at_end(); all.next())
      for (int i = 0; i < kPopcount8[all.node().child_mask]; ++i)
        lookups_->announce(all.node().child(i));
    lookups_->resolve();
  }
  void load() {
    if (at_end()) return;
    if (lookups_)
      load_node();
    else
      load_brick();
    if (has_previous_ && compare_rows(rows_[current_ ^ 1], own()) >= 0)
      input_.corrupt(
          level_, offset(),
          "the node does not follow the one before it: expected the total order of nodes "
          "(docs/format.md)");
  }
  void load_brick() {
    rows_[current_] = joined_ = brick_row(cursor_.brick(), input_.file().hash_bits());
    is_comparable_ = true;
    is_full_ = cursor_.brick() == ~uint64_t{0};
  }
  void load_node();

  DagInput& input_;
  const uint32_t level_;
  const uint64_t full_below_;
  LevelCursor cursor_;
  std::optional<NodeLookups<NodeValues<Hash>>> lookups_;
  // The current node and the node before it, with their children's offsets in the visited file.
  Row rows_[2];
  int current_ = 0;
  bool has_previous_ = false;
  Row joined_;  // the result of row() for the second file
  bool is_comparable_ = false;
  bool is_full_ = false;
};

template <class Hash>
void HashCursor<Hash>::load_node() {
  const voxdag_reader::Node& node = cursor_.node();
  lookups_->prefetch(cursor_.words_ahead());
  Row& own = rows_[current_];
  own.mask = joined_.mask = node.child_mask;
  own.count = joined_.count = kPopcount8[node.child_mask];
  is_comparable_ = true;
  is_full_ = node.child_mask == 255;
  uint64_t hashes[8];
  for (uint32_t i = 0; i < own.count; ++i) {
    const uint64_t child = node.child(static_cast<int>(i));
    const FoundValue<Hash> found = lookups_->next(child);
    if (!found.begins)
      input_.corrupt(level_, offset(),
                     "a child pointer leads to a word at which no node begins: expected a node");
    const uint64_t number = number_in_a(found.value, child);
    hashes[i] = found.value.hash;
    own.children[i] = child;
    if (!kIsA) joined_.children[i] = number - 1;
    is_comparable_ = is_comparable_ && number != 0;
    is_full_ = is_full_ && child == full_below_;
  }
  own.hash = joined_.hash = truncate_hash(
      hash_node(node.child_mask, static_cast<int>(own.count), hashes), input_.file().hash_bits());
}

}  // namespace

struct Join::Below {
  NodeValues<HashOfA> a;
  NodeValues<HashOfB> b;
  NodePair full;
};

Join::Join(DagInput& a, DagInput& b, const SpillSpace& space, const LookupMemory& memory)
    : a_(a), b_(b), space_(space), memory_(memory) {}
Join::~Join() = default;

void Join::add_level(uint32_t level, JoinedLevel& joined) {
  auto done = std::unique_ptr<Below>(new Below{{space_, a_.level(level), memory_.value_bytes},
                                               {space_, b_.level(level), memory_.value_bytes},
                                               {}});
  const NodePair full_below = below_ ? below_->full : NodePair();
  HashCursor a(a_, level, below_ ? &below_->a : nullptr, full_below.a, space_,
               memory_.window_bytes);
  HashCursor b(b_, level, below_ ? &below_->b : nullptr, full_below.b, space_,
               memory_.window_bytes);
  const auto pass_a = [&] {
    done->a.add(a.offset(), {a.hash()});
    joined.hashes_a.add(a.hash());
    if (a.is_full()) joined.full.a = a.offset();
    a.next();
  };
  for (; !b.at_end(); b.next()) {
    bool is_equal = false;
    if (b.is_comparable()) {
      while (!a.at_end() && compare_rows(a.row(), b.row()) < 0) pass_a();
      is_equal = !a.at_end() && compare_rows(a.row(), b.row()) == 0;
    }
    if (is_equal) joined.equal.add({a.offset(), b.offset()});
    done->b.add(b.offset(), {b.hash(), is_equal ? a.offset() + 1 : 0});
    joined.hashes_b.add(b.hash());
    if (b.is_full()) joined.full.b = b.offset();
  }
  while (!a.at_end()) pass_a();
  done->a.finish();
  done->b.finish();
  joined.hashes_a.finish();
  joined.hashes_b.finish();
  joined.equal.finish();
  below_ = std::move(done);
  below_->full = joined.full;
}

}  // namespace voxdag::query
