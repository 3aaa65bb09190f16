// Writes the levels of a combined DAG, from the bricks up. Each level is merged from three sorted
// sequences of rows (result_rows.h): the kept nodes (pair_levels.h) of the first file, the kept
// nodes of the second file, and the results of the level's pairs. Equal rows become one node. So
// the levels are canonical, as after a build.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/format/global/global_writer.h"
#include "query/combine/count_levels.h"
#include "query/combine/join.h"
#include "query/combine/pair_levels.h"
#include "query/combine/result_rows.h"
#include "query/combine/spill/spill.h"
#include "query/dag/dag_input.h"

namespace voxdag::query {

class LevelsWriter {
 public:
  // `counts` receives the changes of the counts of all levels that are written.
  LevelsWriter(DagInput& a, DagInput& b, const SpillSpace& space, const LookupMemory& memory,
               CountLevels& counts, GlobalFileWriter& out);
  ~LevelsWriter();

  // Writes a level. Call it for each level, from the bricks up. `rows` has the rows of the pairs of
  // bricks in the first call, and must be empty in later calls. Writes nothing if the level has no
  // nodes.
  void write_level(uint32_t level, const JoinedLevel& joined, PairLevel& pairs,
                   SpillSorter<PairRow>& rows);
  uint64_t dag_nodes() const { return dag_nodes_; }

 private:
  struct Below;
  void make_rows(SpillSorter<PairRow>& rows);
  void add_pair_results(const SpillList<PairUse>& uses, SpillSorter<KeyedNode>& results);

  DagInput& a_;
  DagInput& b_;
  const SpillSpace& space_;
  const LookupMemory memory_;
  CountLevels& counts_;
  GlobalFileWriter& out_;
  // The results of the places (result_rows.h) from which the next level's rows are made.
  std::unique_ptr<SpillSorter<KeyedNode>> children_;
  std::unique_ptr<Below> below_;  // the level written last
  uint64_t dag_nodes_ = 0;
};

}  // namespace voxdag::query
