// Descends through two DAGs together, level by level, and finds
//
//   - the distinct pairs of cubes whose result is neither empty nor a cube of one of the files;
//   - the *kept* nodes of each file: nodes that become nodes of the new file because a cube of the
//     result is equal to their cube, and all nodes below them;
//   - the *counted* nodes of each file: nodes whose counts must be added or subtracted to compute
//     the counts of the new file (count_levels.h), and all nodes below them.
//
// The requested pairs of a level are sorted, so that equal pairs are found even if the pairs do not
// fit in memory. A pair of equal nodes, which Join has found, is not divided further.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/base/page_buffer.h"
#include "query/combine/join.h"
#include "query/combine/operation.h"
#include "query/combine/result_rows.h"
#include "query/combine/shape.h"
#include "query/combine/spill/spill.h"
#include "query/dag/dag_input.h"

namespace voxdag::query {

// Marked (kept or counted) nodes of one level of one file. `uses` has the places (result_rows.h)
// that use these nodes: the result of the place is a kept node, or the counts of the place change
// by the counts of a counted node.
template <class Use>
struct MarkedNodes {
  explicit MarkedNodes(const SpillSpace& space) : uses(space), bits(space) {}

  SpillSorter<Use> uses;
  // Bit i is set if a marked node begins at word 2i or 2i + 1 of the level. Empty if no node is
  // marked.
  SpillList<uint64_t> bits;
};
using KeptNodes = MarkedNodes<NodeUse>;
using CountedNodes = MarkedNodes<CountUse>;

// Reads MarkedNodes::bits. has() returns true if a marked node begins at `offset`. The offsets of
// successive calls must increase.
class MarkReader {
 public:
  explicit MarkReader(const SpillList<uint64_t>& bits) : reader_(bits) {}
  bool has(uint64_t offset) {
    for (; word_ < offset / 128; ++word_) reader_.pop();
    return reader_.front() >> offset / 2 % 64 & 1;
  }

 private:
  SpillReader<uint64_t> reader_;
  uint64_t word_ = 0;
};

struct PairLevel {
  explicit PairLevel(const SpillSpace& space)
      : pairs(space),
        uses(space),
        kept_a(space),
        kept_b(space),
        counted_a(space),
        counted_b(space) {}

  SpillList<NodePair> pairs;
  SpillList<PairUse> uses;  // by increasing numbers of pairs
  KeptNodes kept_a;
  KeptNodes kept_b;
  CountedNodes counted_a;
  CountedNodes counted_b;
};

// The results of all pairs of bricks: `rows` has the combined bricks that are not empty.
struct BrickResults {
  explicit BrickResults(const SpillSpace& space) : rows(space), counts(space) {}

  SpillSorter<PairRow> rows;
  // For each pair of bricks, sorted by number: the number of voxels in the result, minus the number
  // in the reference file's brick.
  SpillList<KeyedCounts> counts;
};

// Collects MarkedNodes::bits for one level of one file. Memory is allocated at the first mark.
class Marks {
 public:
  Marks(uint64_t level_words, MemoryBudget& budget) : words_(level_words), budget_(&budget) {}

  void mark(uint64_t offset) {
    if (bits_.size() == 0)
      bits_ = PageBuffer<uint64_t>(*budget_, words_ / 128 + 1, "marks of nodes");
    bits_[offset / 128] |= uint64_t{1} << offset / 2 % 64;
  }
  bool empty() const { return bits_.size() == 0; }
  bool has(uint64_t offset) const { return bits_[offset / 128] >> offset / 2 % 64 & 1; }
  void store(SpillList<uint64_t>& to) const {
    for (size_t i = 0; i < bits_.size(); ++i) to.add(bits_[i]);
    to.finish();
  }

 private:
  uint64_t words_;
  MemoryBudget* budget_;
  PageBuffer<uint64_t> bits_;
};

class PairLevels {
 public:
  // `reference` is the file from which the counts of the result are derived, or kEmpty. `joined`
  // has the results of Join for all levels; index 0 is the root's level. With a shape, the
  // operation is kMinus, the shape's cubes are the cubes of the second file, and `b` has no nodes.
  PairLevels(DagInput& a, DagInput& b, const Shape* shape, Operation operation, Outcome reference,
             const std::vector<std::unique_ptr<JoinedLevel>>& joined, const SpillSpace& space)
      : a_(a),
        b_(b),
        shape_(shape),
        operation_(operation),
        reference_(reference),
        joined_(joined),
        space_(space) {}

  // Descends from the root to the bricks. Returns the pairs and the marked nodes of all levels;
  // index 0 is the root's level. Adds the results of the pairs of bricks to `bricks`.
  std::vector<std::unique_ptr<PairLevel>> descend(BrickResults& bricks);
  uint64_t pair_count() const { return pair_count_; }

 private:
  // A level while its pairs and marked nodes are collected.
  struct Open {
    Open(const PairLevels& all, uint32_t opened);
    uint32_t level;
    std::unique_ptr<PairLevel> pairs;
    std::unique_ptr<SpillSorter<PairRequest>> requests;
    Marks kept_a, kept_b;
    Marks counted_a, counted_b;
  };

  void add(Open& to, const NodePair& cubes, uint64_t place) const;
  void add_result(Open& to, const NodePair& cubes, Outcome result, uint64_t place) const;
  void add_counts(Open& to, const NodePair& cubes, Outcome of, uint64_t place, int64_t sign) const;
  void number_pairs(Open& level) const;
  std::array<uint64_t, 8> children_of_b(uint32_t level, uint64_t cube) const;
  void expand_pairs(const Open& level, Open& below) const;
  void add_bricks(const Open& level, BrickResults& bricks) const;
  void mark_children(DagInput& input, uint32_t level, const Marks& marks, Marks& below) const;
  void mark_all_children(const Open& level, Open& below) const;

  DagInput& a_;
  DagInput& b_;
  const Shape* const shape_;
  const Operation operation_;
  const Outcome reference_;
  const std::vector<std::unique_ptr<JoinedLevel>>& joined_;
  const SpillSpace& space_;
  uint64_t pair_count_ = 0;
};

}  // namespace voxdag::query
