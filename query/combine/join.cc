#include "query/combine/join.h"

#include <memory>
#include <optional>
#include <type_traits>
#include <utility>

#include "query/combine/result_rows.h"
#include "query/combine/spill/node_values.h"

namespace voxdag::query {

// The hash of a node of the first file.
using HashOfA = uint64_t;
// The hash of a node of the second file. `number_in_a` is 1 plus the word offset of the equal node
// of the first file, or 0 if the first file has no such node.
struct HashOfB {
  uint64_t hash = 0;
  uint64_t number_in_a = 0;
};

namespace {

uint64_t hash_of(HashOfA hash) { return hash; }
uint64_t hash_of(const HashOfB& node) { return node.hash; }

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
  uint64_t hash() const { return hash_; }
  bool is_full() const { return is_full_; }
  // True if the first file has an equal node for each child of the current node. Otherwise the
  // first file cannot have a node equal to the current node.
  bool is_comparable() const { return is_comparable_; }
  // Returns the current node as a Row (result_rows.h) with the offsets that its children have in
  // the first file. Requires is_comparable().
  Row row() const {
    Row row = row_of(words_, hash_);
    if (!kIsA && lookups_)
      for (uint32_t i = 0; i < row.count; ++i) row.children[i] = numbers_in_a_[i] - 1;
    return row;
  }
  void next() {
    previous_words_ = words_;
    previous_hash_ = hash_;
    cursor_.next();
    load();
  }

 private:
  static constexpr bool kIsA = std::is_same_v<Hash, HashOfA>;

  // Returns the node or the brick at `words`, with its children's offsets in the visited file.
  Row row_of(const uint32_t* words, uint64_t hash) const {
    if (!lookups_)
      return brick_row(words[0] | static_cast<uint64_t>(words[1]) << 32, input_.file().hash_bits());
    const voxdag_reader::Node node{words[0], words + 1, cursor_.is_wide()};
    Row row{hash, node.child_mask, kPopcount8[node.child_mask], {}};
    for (uint32_t i = 0; i < row.count; ++i) row.children[i] = node.child(static_cast<int>(i));
    return row;
  }
  void announce() {
    if (!lookups_->needs_announcement()) return;
    for (LevelCursor all(input_, level_); !all.at_end(); all.next())
      for (int i = 0; i < kPopcount8[all.node().child_mask]; ++i)
        lookups_->announce(all.node().child(i));
    lookups_->resolve();
  }
  void load() {
    if (at_end()) return;
    words_ = cursor_.words().data();
    if (lookups_)
      load_node();
    else
      load_brick();
    if (previous_words_ && previous_hash_ >= hash_) expect_order();
  }
  void expect_order() const {
    if (compare_rows(row_of(previous_words_, previous_hash_), row_of(words_, hash_)) < 0) return;
    input_.corrupt(level_, offset(),
                   "the node does not follow the one before it: expected the total order of nodes "
                   "(docs/format.md)");
  }
  void load_brick() {
    const uint64_t brick = cursor_.brick();
    hash_ = brick_row(brick, input_.file().hash_bits()).hash;
    is_comparable_ = true;
    is_full_ = brick == ~uint64_t{0};
  }
  void load_node();

  DagInput& input_;
  const uint32_t level_;
  const uint64_t full_below_;
  LevelCursor cursor_;
  std::optional<NodeLookups<NodeValues<Hash>>> lookups_;
  const uint32_t* words_ = nullptr;  // of the current node
  uint64_t hash_ = 0;
  uint64_t numbers_in_a_[8] = {};             // of the children of a node of the second file
  const uint32_t* previous_words_ = nullptr;  // of the node before the current one, if any
  uint64_t previous_hash_ = 0;
  bool is_comparable_ = false;
  bool is_full_ = false;
};

template <class Hash>
void HashCursor<Hash>::load_node() {
  const voxdag_reader::Node& node = cursor_.node();
  lookups_->visit(cursor_);
  const int count = kPopcount8[node.child_mask];
  bool is_comparable = true, is_full = node.child_mask == 255;
  uint64_t hash = node_hash_begin(node.child_mask);
  for (int i = 0; i < count; ++i) {
    const uint64_t child = node.child(i);
    const FoundValue<Hash> found = lookups_->next(child);
    if (!found.begins)
      input_.corrupt(level_, offset(),
                     "a child pointer leads to a word at which no node begins: expected a node");
    hash = node_hash_add(hash, hash_of(found.value));
    if constexpr (!kIsA) {
      numbers_in_a_[i] = found.value.number_in_a;
      is_comparable = is_comparable && numbers_in_a_[i] != 0;
    }
    is_full = is_full && child == full_below_;
  }
  hash_ = truncate_hash(node_hash_end(hash), input_.file().hash_bits());
  is_comparable_ = is_comparable;
  is_full_ = is_full;
}

// Returns a negative number if the node of `a` is before the node of `b` in the total order, 0 if
// the nodes are equal, otherwise a positive number. Requires b.is_comparable().
int compare(const HashCursor<HashOfA>& a, const HashCursor<HashOfB>& b) {
  if (a.hash() != b.hash()) return a.hash() < b.hash() ? -1 : 1;
  return compare_rows(a.row(), b.row());
}

}  // namespace

struct Join::Below {
  NodeValues<HashOfA> a;
  NodeValues<HashOfB> b;
  JoinedLevel& joined;
  // If the hashes of the nodes of the first file and the list of these hashes are both in memory,
  // the list is made from them when they are no longer looked up.
  bool shares_hashes;
};

Join::Join(DagInput& a, DagInput& b, const SpillSpace& space, const LookupMemory& memory)
    : a_(a), b_(b), space_(space), memory_(memory) {}
Join::~Join() = default;

void Join::add_level(uint32_t level, JoinedLevel& joined) {
  NodeValues<HashOfA> hashes_a(space_, a_.level(level), memory_.value_bytes);
  const bool shares_hashes =
      hashes_a.is_resident() && joined.hashes_a.has_room(a_.level(level).node_count);
  auto done = std::unique_ptr<Below>(new Below{
      std::move(hashes_a), {space_, b_.level(level), memory_.value_bytes}, joined, shares_hashes});
  const NodePair full_below = below_ ? below_->joined.full : NodePair();
  HashCursor a(a_, level, below_ ? &below_->a : nullptr, full_below.a, space_,
               memory_.window_bytes);
  HashCursor b(b_, level, below_ ? &below_->b : nullptr, full_below.b, space_,
               memory_.window_bytes);
  const auto pass_a = [&] {
    done->a.add(a.offset(), a.hash());
    if (!shares_hashes) joined.hashes_a.add(a.hash());
    if (a.is_full()) joined.full.a = a.offset();
    a.next();
  };
  for (; !b.at_end(); b.next()) {
    bool is_equal = false;
    if (b.is_comparable()) {
      int order = 1;
      while (!a.at_end() && (order = compare(a, b)) < 0) pass_a();
      is_equal = !a.at_end() && order == 0;
    }
    if (is_equal) joined.equal.add({a.offset(), b.offset()});
    done->b.add(b.offset(), {b.hash(), is_equal ? a.offset() + 1 : 0});
    joined.hashes_b.add(b.hash());
    if (b.is_full()) joined.full.b = b.offset();
  }
  while (!a.at_end()) pass_a();
  done->a.finish();
  done->b.finish();
  joined.hashes_b.finish();
  joined.equal.finish();
  finish();
  below_ = std::move(done);
}

void Join::finish() {
  if (!below_) return;
  if (below_->shares_hashes) below_->joined.hashes_a.adopt(below_->a.take_values());
  below_->joined.hashes_a.finish();
  below_.reset();
}

}  // namespace voxdag::query
