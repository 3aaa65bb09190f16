// A copy of a DAG in which the enclosed space is filled: empty cells that are not connected with
// the space around the grid, through common faces of empty cells, are set. The surface of this DAG
// is the part of the original surface that is visible from outside. The time depends on the number
// of unique nodes (core/dag/space/space_labels.h).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/page_buffer.h"
#include "query/dag/dag_view.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

class FilledDag {
 public:
  // Makes the filled copy in the grid that has 2^grid_levels cells per edge. This is the grid of
  // `dag` or a coarser one. `dag` must not be empty. `path` is the name of the file in messages.
  // Throws Error{kOutOfMemory} if the copy does not fit in the budget, Error{kCorrupt} if words of
  // a level are not nodes, and Error{kCanceled}.
  FilledDag(const DagView& dag, uint32_t grid_levels, const std::string& path, MemoryBudget& budget,
            const CancelToken& cancel);
  const DagView& view() const { return *view_; }

 private:
  std::vector<PageBuffer<uint32_t>> levels_;
  std::optional<DagView> view_;
};

}  // namespace voxdag::query
