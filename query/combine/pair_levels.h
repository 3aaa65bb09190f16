// Descends through two DAGs together, level by level, and finds
//
//   - the distinct pairs of cubes whose result is neither empty nor a cube of one of the files;
//   - the *kept* nodes of each file: nodes that are a result, and all nodes below them.
//
// The pairs of a level are sorted, so that equal pairs are found, also if they do not fit in
// memory. Pairs of equal nodes end there, because Join has found the equal nodes.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/base/page_buffer.h"
#include "query/combine/dag_input.h"
#include "query/combine/join.h"
#include "query/combine/operation.h"
#include "query/combine/result_rows.h"
#include "query/combine/spill.h"

namespace voxdag::query {

// The nodes of one file that are kept on one level.
struct KeptNodes {
  explicit KeptNodes(const SpillSpace& space) : uses(space), bits(space) {}

  SpillSorter<NodeUse> uses;  // places whose result is a node of this file
  // A bit for each word offset / 2, set if a kept node begins there. Empty if no node is kept.
  SpillList<uint64_t> bits;
};

struct PairLevel {
  explicit PairLevel(const SpillSpace& space)
      : pairs(space), uses(space), kept_a(space), kept_b(space) {}

  SpillList<NodePair> pairs;
  SpillList<PairUse> uses;  // by increasing numbers of pairs
  KeptNodes kept_a;
  KeptNodes kept_b;
};

// Collects the kept nodes of one level of one file.
class KeptMarks {
 public:
  KeptMarks(uint64_t level_words, MemoryBudget& budget) : words_(level_words), budget_(&budget) {}

  void mark(uint64_t offset) {
    if (bits_.size() == 0)
      bits_ = PageBuffer<uint64_t>(*budget_, words_ / 128 + 1, "marks of the nodes to keep");
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
  // `joined` has the facts about all levels, from the root to the bricks.
  PairLevels(DagInput& a, DagInput& b, Operation operation,
             const std::vector<std::unique_ptr<JoinedLevel>>& joined, const SpillSpace& space)
      : a_(a), b_(b), operation_(operation), joined_(joined), space_(space) {}

  // Returns all levels, from the root to the bricks, and adds the results of pairs of bricks.
  std::vector<std::unique_ptr<PairLevel>> descend(SpillSorter<PairRow>& bricks);
  uint64_t pair_count() const { return pair_count_; }

 private:
  // A level to which nodes are added.
  struct Open {
    Open(const PairLevels& all, uint32_t opened);
    uint32_t level;
    std::unique_ptr<PairLevel> pairs;
    std::unique_ptr<SpillSorter<PairRequest>> requests;
    KeptMarks marks_a, marks_b;
  };

  void add(Open& to, const NodePair& cubes, uint64_t place) const;
  void number_pairs(Open& level) const;
  void expand_pairs(const Open& level, Open& below) const;
  void add_bricks(const Open& level, SpillSorter<PairRow>& bricks) const;
  void mark_children(DagInput& input, uint32_t level, const KeptMarks& marks,
                     KeptMarks& below) const;

  DagInput& a_;
  DagInput& b_;
  const Operation operation_;
  const std::vector<std::unique_ptr<JoinedLevel>>& joined_;
  const SpillSpace& space_;
  uint64_t pair_count_ = 0;
};

}  // namespace voxdag::query
