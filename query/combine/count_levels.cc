#include "query/combine/count_levels.h"

#include <utility>

#include "core/base/host_device.h"

namespace voxdag::query {

// Called between two levels. For each pair of the next coarser level, computes the change of its
// counts: the sum of the changes of the pair's places (result_rows.h).
void CountLevels::sum_pairs() {
  auto sums = std::make_unique<SpillList<KeyedCounts>>(space_);
  places_->finish();
  places_->begin();
  while (!places_->at_end()) {
    KeyedCounts sum{pair_of(places_->front().key), {}};
    for (; !places_->at_end() && pair_of(places_->front().key) == sum.key; places_->pop())
      sum.counts += places_->front().counts;
    sums->add(sum);
  }
  sums->finish();
  sums_ = std::move(sums);
  pair_changes_ = sums_.get();
}

void CountLevels::begin_level() {
  next_pair_.reset();
  if (places_) sum_pairs();
  next_pair_.emplace(*pair_changes_);
  places_ = std::make_unique<SpillSorter<KeyedCounts>>(space_);
}

void CountLevels::add_pair(const PairUse& use, bool has_node) {
  while (!next_pair_->at_end() && next_pair_->front().key < use.pair) next_pair_->pop();
  OctreeCounts change;
  if (!next_pair_->at_end() && next_pair_->front().key == use.pair)
    change = next_pair_->front().counts;
  if (has_node) ++change.nodes;
  if (reference_ != Outcome::kEmpty) --change.nodes;
  places_->add({use.place, change});
}

void CountLevels::add_nodes(uint32_t level, PairLevel& pairs) {
  add_nodes(a_, level, pairs.counted_a, below_a_);
  add_nodes(b_, level, pairs.counted_b, below_b_);
}

// Counts the voxels and octree nodes in the subtree of each counted node of a level (`nodes`, see
// pair_levels.h). Adds these counts to the changes of the places that use the node, or subtracts
// them. `below` has the counts of the next finer level, and receives the counts of this level.
void CountLevels::add_nodes(DagInput& input, uint32_t level, CountedNodes& nodes,
                            std::unique_ptr<Counts>& below) {
  const std::unique_ptr<Counts> finer = std::exchange(below, nullptr);
  if (nodes.bits.size() == 0) return;
  below = std::make_unique<Counts>(space_, input.level(level), memory_.value_bytes);
  std::optional<NodeLookups<Counts>> lookups;
  if (finer) lookups.emplace(*finer, space_, memory_.window_bytes);
  const auto for_each = [&](const auto& visit) {
    MarkReader marks(nodes.bits);
    for (LevelCursor cursor(input, level); !cursor.at_end(); cursor.next())
      if (marks.has(cursor.offset())) visit(cursor);
  };
  const auto child_count = [](const LevelCursor& cursor) {
    return kPopcount8[cursor.node().child_mask];
  };
  if (lookups && lookups->needs_announcement()) {
    for_each([&](const LevelCursor& cursor) {
      for (int i = 0; i < child_count(cursor); ++i) lookups->announce(cursor.node().child(i));
    });
    lookups->resolve();
  }
  nodes.uses.begin();
  for_each([&](const LevelCursor& cursor) {
    OctreeCounts counts{1, 0};
    if (!lookups) {
      counts.voxels = static_cast<uint64_t>(popcount64(cursor.brick()));
    } else {
      lookups->visit(cursor);
      for (int i = 0; i < child_count(cursor); ++i)
        counts += lookups->next(cursor.node().child(i)).value;
    }
    below->add(cursor.offset(), counts);
    for (; !nodes.uses.at_end() && nodes.uses.front().offset == cursor.offset(); nodes.uses.pop()) {
      const auto sign = static_cast<uint64_t>(nodes.uses.front().sign);
      places_->add({nodes.uses.front().place, {sign * counts.nodes, sign * counts.voxels}});
    }
  });
  below->finish();
}

OctreeCounts CountLevels::total() {
  OctreeCounts total;
  if (reference_ != Outcome::kEmpty) {
    const voxdag_reader::File& file = (reference_ == Outcome::kA ? a_ : b_).file();
    total = {file.svo_nodes(), file.voxels()};
  }
  places_->finish();
  places_->begin();
  for (; !places_->at_end(); places_->pop()) total += places_->front().counts;
  return total;
}

}  // namespace voxdag::query
