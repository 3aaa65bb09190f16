#include "query/combine/pair_levels.h"

#include <array>
#include <utility>

#include "core/base/host_device.h"

namespace voxdag::query {
namespace {

// Returns the offsets of a node's children by their index; kNoNode if a child does not exist.
std::array<uint64_t, 8> children_of(const voxdag_reader::Node& node) {
  std::array<uint64_t, 8> children;
  int next = 0;
  for (size_t c = 0; c < 8; ++c)
    children[c] = node.child_mask >> c & 1 ? node.child(next++) : kNoNode;
  return children;
}

void add_use(KeptNodes& kept, KeptMarks& marks, const NodeUse& use) {
  kept.uses.add(use);
  marks.mark(use.offset);
}

}  // namespace

PairLevels::Open::Open(const PairLevels& all, uint32_t opened)
    : level(opened),
      pairs(std::make_unique<PairLevel>(all.space_)),
      requests(std::make_unique<SpillSorter<PairRequest>>(all.space_)),
      marks_a(all.a_.level(opened).word_count, all.space_.budget),
      marks_b(all.b_.level(opened).word_count, all.space_.budget) {}

void PairLevels::add(Open& to, const NodePair& cubes, uint64_t place) const {
  switch (outcome_of(operation_, cubes, joined_[to.level]->full)) {
    case Outcome::kEmpty:
      break;
    case Outcome::kA:
      add_use(to.pairs->kept_a, to.marks_a, {cubes.a, place});
      break;
    case Outcome::kB:
      add_use(to.pairs->kept_b, to.marks_b, {cubes.b, place});
      break;
    case Outcome::kUnknown:
      to.requests->add({cubes, place});
      break;
  }
}

// Numbers the distinct pairs among the requests. A pair of equal nodes gets no number, because its
// result is known: one of the nodes, or nothing.
void PairLevels::number_pairs(Open& level) const {
  SpillSorter<PairRequest>& requests = *level.requests;
  SpillReader equal(joined_[level.level]->equal);
  const bool keep_equal = outcome_of_equal(operation_) == Outcome::kA;
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
      else if (keep_equal)
        add_use(level.pairs->kept_a, level.marks_a, {cubes.a, place});
    }
  }
  level.requests.reset();
  level.pairs->pairs.finish();
  level.pairs->uses.finish();
}

void PairLevels::expand_pairs(const Open& level, Open& below) const {
  uint64_t number = 0;
  for (SpillReader pair(level.pairs->pairs); !pair.at_end(); pair.pop(), ++number) {
    const auto a = children_of(a_.node(level.level, pair.front().a));
    const auto b = children_of(b_.node(level.level, pair.front().b));
    for (int c = 0; c < 8; ++c)
      add(below, {a[static_cast<size_t>(c)], b[static_cast<size_t>(c)]}, place_of(number, c));
  }
}

void PairLevels::add_bricks(const Open& level, SpillSorter<PairRow>& bricks) const {
  uint64_t number = 0;
  for (SpillReader pair(level.pairs->pairs); !pair.at_end(); pair.pop(), ++number) {
    const uint64_t mask =
        combine_bricks(operation_, a_.brick(pair.front().a), b_.brick(pair.front().b));
    if (mask != 0)
      bricks.add({brick_row(mask, a_.file().hash_bits()),
                  {1, static_cast<uint64_t>(popcount64(mask))},
                  number});
  }
}

void PairLevels::mark_children(DagInput& input, uint32_t level, const KeptMarks& marks,
                               KeptMarks& below) const {
  if (marks.empty()) return;
  for (LevelCursor cursor(input, level); !cursor.at_end(); cursor.next()) {
    if (!marks.has(cursor.offset())) continue;
    for (int i = 0; i < kPopcount8[cursor.node().child_mask]; ++i)
      below.mark(cursor.node().child(i));
  }
}

std::vector<std::unique_ptr<PairLevel>> PairLevels::descend(SpillSorter<PairRow>& bricks) {
  std::vector<std::unique_ptr<PairLevel>> levels;
  Open open(*this, 0);
  const auto root = [](DagInput& input) { return input.file().empty() ? kNoNode : 0; };
  add(open, {root(a_), root(b_)}, 0);
  for (;;) {
    number_pairs(open);
    pair_count_ += open.pairs->pairs.size();
    open.pairs->kept_a.uses.finish(true);
    open.pairs->kept_b.uses.finish(true);
    open.marks_a.store(open.pairs->kept_a.bits);
    open.marks_b.store(open.pairs->kept_b.bits);
    if (open.level == a_.file().brick_level()) break;
    Open below(*this, open.level + 1);
    expand_pairs(open, below);
    mark_children(a_, open.level, open.marks_a, below.marks_a);
    mark_children(b_, open.level, open.marks_b, below.marks_b);
    levels.push_back(std::move(open.pairs));
    open = std::move(below);
  }
  add_bricks(open, bricks);
  levels.push_back(std::move(open.pairs));
  return levels;
}

}  // namespace voxdag::query
