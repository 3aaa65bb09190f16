// A copy of a DAG with turned axes. A turn permutes the children of each node and the voxels of
// each brick. Nodes keep their sizes, so the copy has the same word offsets as the original, and
// all numbers of nodes and words remain valid.
#pragma once

#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "query/dag/dag_view.h"
#include "query/export/turn/axis_turn.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

class TurnedDag {
 public:
  // `path` names the file in errors. Throws Error{kOutOfMemory} if the copy does not fit in the
  // budget, and Error{kCorrupt} for words that are not a node. The DAG must not be empty.
  TurnedDag(const DagView& dag, const AxisTurn& turn, const std::string& path, MemoryBudget& budget,
            const CancelToken& cancel);
  const DagView& view() const { return view_; }

 private:
  std::vector<PageBuffer<uint32_t>> levels_;
  DagView view_;
};

}  // namespace voxdag::query
