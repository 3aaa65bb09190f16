#include "query/combine/pair_levels.h"

#include <utility>

#include "core/base/host_device.h"

namespace voxdag::query {
namespace {

template <class Use>
void add_use(MarkedNodes<Use>& nodes, Marks& marks, const Use& use) {
  if (use.offset == kNoNode) return;
  nodes.uses.add(use);
  marks.mark(use.offset);
}

// Completes nodes.uses, and stores `marks` in nodes.bits. Must be called after the last mark.
template <class Use>
void finish(MarkedNodes<Use>& nodes, const Marks& marks) {
  nodes.uses.finish(true);
  marks.store(nodes.bits);
}

}  // namespace

PairLevels::Open::Open(const PairLevels& all, uint32_t opened)
    : level(opened),
      pairs(std::make_unique<PairLevel>(all.space_)),
      requests(std::make_unique<SpillSorter<PairRequest>>(all.space_)),
      kept_a(all.a_.level(opened).word_count, all.space_.budget),
      kept_b(all.b_.level(opened).word_count, all.space_.budget),
      counted_a(all.a_.level(opened).word_count, all.space_.budget),
      counted_b(all.b_.level(opened).word_count, all.space_.budget) {}

void PairLevels::add(Open& to, const NodePair& cubes, uint64_t place) const {
  const Outcome outcome = outcome_of(operation_, cubes, joined_[to.level]->full);
  if (outcome == Outcome::kUnknown)
    to.requests->add({cubes, place});
  else
    add_result(to, cubes, outcome, place);
}

// Adds to `to` the known result of a place (result_rows.h), and the change of the place's counts
// relative to the reference file (count_levels.h).
void PairLevels::add_result(Open& to, const NodePair& cubes, Outcome result, uint64_t place) const {
  if (result == Outcome::kA) add_use<NodeUse>(to.pairs->kept_a, to.kept_a, {cubes.a, place});
  if (result == Outcome::kB) add_use<NodeUse>(to.pairs->kept_b, to.kept_b, {cubes.b, place});
  if (result == reference_) return;
  add_counts(to, cubes, result, place, 1);
  add_counts(to, cubes, reference_, place, -1);
}

void PairLevels::add_counts(Open& to, const NodePair& cubes, Outcome of, uint64_t place,
                            int64_t sign) const {
  if (of == Outcome::kA)
    add_use<CountUse>(to.pairs->counted_a, to.counted_a, {cubes.a, place, sign});
  if (of == Outcome::kB)
    add_use<CountUse>(to.pairs->counted_b, to.counted_b, {cubes.b, place, sign});
}

// Finds the distinct pairs among the requests, and numbers them. A pair of equal nodes gets no
// number: its result is the node of A, or empty. If the result is the node of A, it does not change
// the counts, even if the reference file is B, because the node of B has the same counts.
void PairLevels::number_pairs(Open& level) const {
  SpillSorter<PairRequest>& requests = *level.requests;
  SpillReader equal(joined_[level.level]->equal);
  const Outcome of_equal = outcome_of_equal(operation_);
  requests.finish();
  requests.begin();
  while (!requests.at_end()) {
    const NodePair cubes = requests.front().cubes;
    while (!equal.at_end() && equal.front() < cubes) equal.pop();
    const bool is_equal = !equal.at_end() && equal.front() == cubes;
    const uint64_t number = level.pairs->pairs.size();
    if (!is_equal) level.pairs->pairs.add(cubes);
    for (; !requests.at_end() && requests.front().cubes == cubes; requests.pop()) {
      const uint64_t place = requests.front().place;
      if (!is_equal)
        level.pairs->uses.add({number, place});
      else if (of_equal == Outcome::kA && reference_ == Outcome::kB)
        add_use<NodeUse>(level.pairs->kept_a, level.kept_a, {cubes.a, place});
      else
        add_result(level, cubes, of_equal, place);
    }
  }
  level.requests.reset();
  level.pairs->pairs.finish();
  level.pairs->uses.finish();
}

std::array<uint64_t, 8> PairLevels::children_of_b(uint32_t level, uint64_t cube) const {
  if (shape_) return shape_->children(a_.file().grid_levels(), level, cube);
  return children_by_index(b_.node(level, cube));
}

void PairLevels::expand_pairs(const Open& level, Open& below) const {
  uint64_t number = 0;
  for (SpillReader pair(level.pairs->pairs); !pair.at_end(); pair.pop(), ++number) {
    const auto a = children_by_index(a_.node(level.level, pair.front().a));
    const auto b = children_of_b(level.level, pair.front().b);
    for (int c = 0; c < 8; ++c)
      add(below, {a[static_cast<size_t>(c)], b[static_cast<size_t>(c)]}, place_of(number, c));
  }
}

void PairLevels::add_bricks(const Open& level, BrickResults& bricks) const {
  const auto voxels = [](uint64_t mask) { return static_cast<uint64_t>(popcount64(mask)); };
  uint64_t number = 0;
  for (SpillReader pair(level.pairs->pairs); !pair.at_end(); pair.pop(), ++number) {
    const uint64_t a = a_.brick(pair.front().a);
    const uint64_t b = shape_ ? shape_->brick(pair.front().b) : b_.brick(pair.front().b);
    const uint64_t mask = combine_bricks(operation_, a, b);
    if (mask != 0) bricks.rows.add({brick_row(mask, a_.file().hash_bits()), number});
    const uint64_t before = reference_ == Outcome::kA ? a : reference_ == Outcome::kB ? b : 0;
    bricks.counts.add({number, {0, voxels(mask) - voxels(before)}});
  }
  bricks.counts.finish();
}

void PairLevels::mark_children(DagInput& input, uint32_t level, const Marks& marks,
                               Marks& below) const {
  if (marks.empty()) return;
  for (LevelCursor cursor(input, level); !cursor.at_end(); cursor.next()) {
    if (!marks.has(cursor.offset())) continue;
    const voxdag_reader::Node& node = cursor.node();
    for (int i = 0, count = kPopcount8[node.child_mask]; i < count; ++i) below.mark(node.child(i));
  }
}

void PairLevels::mark_all_children(const Open& level, Open& below) const {
  mark_children(a_, level.level, level.kept_a, below.kept_a);
  mark_children(b_, level.level, level.kept_b, below.kept_b);
  mark_children(a_, level.level, level.counted_a, below.counted_a);
  mark_children(b_, level.level, level.counted_b, below.counted_b);
}

std::vector<std::unique_ptr<PairLevel>> PairLevels::descend(BrickResults& bricks) {
  std::vector<std::unique_ptr<PairLevel>> levels;
  Open open(*this, 0);
  const auto root = [](DagInput& input) { return input.file().empty() ? kNoNode : 0; };
  add(open, {root(a_), shape_ ? shape_->root(a_.file().grid_levels()) : root(b_)}, 0);
  for (;;) {
    number_pairs(open);
    pair_count_ += open.pairs->pairs.size();
    finish(open.pairs->kept_a, open.kept_a);
    finish(open.pairs->kept_b, open.kept_b);
    finish(open.pairs->counted_a, open.counted_a);
    finish(open.pairs->counted_b, open.counted_b);
    if (open.level == a_.file().brick_level()) break;
    Open below(*this, open.level + 1);
    expand_pairs(open, below);
    mark_all_children(open, below);
    levels.push_back(std::move(open.pairs));
    open = std::move(below);
  }
  add_bricks(open, bricks);
  levels.push_back(std::move(open.pairs));
  return levels;
}

}  // namespace voxdag::query
