// Computes how many voxels and octree nodes the new file has. result_rows.h defines places and
// pairs.
//
// The counts of the new file are the counts of the *reference* file, which is one of the two files
// (reference_of()), plus changes. The counts change at each place where the result is not the
// reference file's node. The change of a pair is the sum of the changes of its places, so the
// changes are computed from the bricks up. Only the nodes that are added or left out at a place,
// and the nodes below them, must be counted. Counts are unsigned and wrap around modulo 2^64, so
// that they can also store negative changes.
#pragma once

#include <memory>
#include <optional>

#include "query/combine/operation.h"
#include "query/combine/pair_levels.h"
#include "query/combine/spill/node_values.h"
#include "query/combine/spill/spill.h"
#include "query/dag/dag_input.h"

namespace voxdag::query {

class CountLevels {
 public:
  // `bricks` has, for each pair of bricks, the change of the numbers of voxels and octree nodes
  // relative to `reference`.
  CountLevels(DagInput& a, DagInput& b, Outcome reference, const SpillList<KeyedCounts>& bricks,
              const SpillSpace& space, const LookupMemory& memory)
      : a_(a),
        b_(b),
        reference_(reference),
        space_(space),
        memory_(memory),
        pair_changes_(&bricks) {}

  // For each level, from the bricks up, call these three functions in this order. Call add_pair()
  // for each place (result_rows.h) whose result is the result of a pair of this level, in the order
  // of increasing pair numbers.
  void begin_level();
  // Adds the change of the counts of use.place, whose result is the result of use.pair. `has_node`
  // is false if this result is empty.
  void add_pair(const PairUse& use, bool has_node);
  void add_nodes(uint32_t level, PairLevel& pairs);

  // Returns the counts of the new file. Must be called after the root level.
  OctreeCounts total();

 private:
  using Counts = NodeValues<OctreeCounts>;
  void add_nodes(DagInput& input, uint32_t level, CountedNodes& nodes,
                 std::unique_ptr<Counts>& below);
  void sum_pairs();

  DagInput& a_;
  DagInput& b_;
  const Outcome reference_;
  const SpillSpace& space_;
  const LookupMemory memory_;
  // Changes of the counts of the current level's pairs.
  const SpillList<KeyedCounts>* pair_changes_;
  std::unique_ptr<SpillList<KeyedCounts>> sums_;
  std::optional<SpillReader<KeyedCounts>> next_pair_;
  // Changes of the counts of the places (result_rows.h) whose results are pairs or nodes of the
  // current level.
  std::unique_ptr<SpillSorter<KeyedCounts>> places_;
  // For each file: the counts of the counted nodes (pair_levels.h) of the level that was added
  // last.
  std::unique_ptr<Counts> below_a_, below_b_;
};

}  // namespace voxdag::query
