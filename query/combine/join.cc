#include "query/combine/join.h"

#include <memory>
#include <optional>
#include <utility>

#include "query/combine/node_values.h"
#include "query/combine/row.h"

namespace voxdag::query {

struct HashedNode {
  uint64_t hash = 0;
  // make_tag() of a number: the offset of the first file's equal node plus 1, or 0 if no node is
  // equal.
  uint64_t tag = 0;
};

using HashedLevel = NodeValues<HashedNode>;

namespace {

// Hashes the nodes of a level in the order of the file.
class HashCursor {
 public:
  // `below` has the hashes of the next finer level; null for bricks. `full_below` is the offset of
  // the full cube of that level.
  HashCursor(DagInput& input, uint32_t level, const HashedLevel* below, uint64_t full_below,
             const SpillSpace& space, uint64_t window_bytes)
      : input_(input), level_(level), full_below_(full_below), cursor_(input, level) {
    if (below) {
      lookups_.emplace(*below, space, window_bytes);
      below_ = below->is_resident() ? below : nullptr;
      announce();
    }
    load();
  }

  bool at_end() const { return cursor_.at_end(); }
  uint64_t offset() const { return cursor_.offset(); }
  uint64_t hash() const { return own_.hash; }
  bool is_full() const { return is_full_; }
  // True if the first file has all children, so that it may have the node.
  bool is_comparable() const { return is_comparable_; }
  // Returns the node with its children's offsets in the first file. Requires is_comparable().
  const Row& row() const { return joined_; }
  void next() {
    previous_ = own_;
    cursor_.next();
    load();
  }

 private:
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
    if (previous_.count > 0 && compare_rows(previous_, own_) >= 0)
      input_.corrupt(level_, offset(),
                     "the node does not follow the one before it in the total order of nodes "
                     "(docs/format.md)");
  }
  void load_brick() {
    own_ = joined_ = brick_row(cursor_.brick(), input_.file().hash_bits());
    is_comparable_ = true;
    is_full_ = cursor_.brick() == ~uint64_t{0};
  }
  void load_node();

  DagInput& input_;
  const uint32_t level_;
  const uint64_t full_below_;
  LevelCursor cursor_;
  std::optional<NodeLookups<HashedNode>> lookups_;
  const HashedLevel* below_ = nullptr;  // only to prefetch
  Row own_;                             // with the children's offsets in the node's own file
  Row joined_;
  Row previous_;
  bool is_comparable_ = false;
  bool is_full_ = false;
};

void HashCursor::load_node() {
  const voxdag_reader::Node& node = cursor_.node();
  if (below_)
    for (const uint32_t word : cursor_.words_ahead()) __builtin_prefetch(below_->find(word));
  own_.mask = joined_.mask = node.child_mask;
  own_.count = joined_.count = kPopcount8[node.child_mask];
  is_comparable_ = true;
  is_full_ = node.child_mask == 255;
  uint64_t hashes[8];
  for (uint32_t i = 0; i < own_.count; ++i) {
    const uint64_t child = node.child(static_cast<int>(i));
    const HashedNode found = lookups_->next(child);
    if (!is_tag_of(found.tag, child))
      input_.corrupt(level_, offset(), "a child is at a word where no node begins");
    hashes[i] = found.hash;
    own_.children[i] = child;
    joined_.children[i] = number_of_tag(found.tag) - 1;
    is_comparable_ = is_comparable_ && number_of_tag(found.tag) != 0;
    is_full_ = is_full_ && child == full_below_;
  }
  own_.hash = joined_.hash = truncate_hash(
      hash_node(node.child_mask, static_cast<int>(own_.count), hashes), input_.file().hash_bits());
}

}  // namespace

struct Join::Below {
  HashedLevel a, b;
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
    done->a.add(a.offset(), {a.hash(), make_tag(a.offset() + 1, a.offset())});
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
    done->b.add(b.offset(), {b.hash(), make_tag(is_equal ? a.offset() + 1 : 0, b.offset())});
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
