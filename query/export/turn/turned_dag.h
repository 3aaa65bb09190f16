// A copy of a DAG with turned axes (axis_turn.h). The turn permutes the children of each node and
// the voxels of each brick. All nodes keep their sizes and their word offsets, so offsets into the
// original DAG are also valid in the copy.
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
  // `dag` must not be empty. `path` is the name of the file in messages. Throws Error{kOutOfMemory}
  // if the copy does not fit in the budget, and Error{kCorrupt} if words of a level are not nodes.
  TurnedDag(const DagView& dag, const AxisTurn& turn, const std::string& path, MemoryBudget& budget,
            const CancelToken& cancel);
  const DagView& view() const { return view_; }

 private:
  std::vector<PageBuffer<uint32_t>> levels_;
  DagView view_;
};

}  // namespace voxdag::query
