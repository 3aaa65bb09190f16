// Exports several selections of one file in one format. If the axes must be turned (axis_turn.h),
// all of these exports use the same turned copy of the DAG.
#pragma once

#include <optional>
#include <string>

#include "core/base/memory_budget.h"
#include "query/dag/dag_view.h"
#include "query/export/export.h"
#include "query/export/outside/filled_dag.h"
#include "query/export/turn/turned_dag.h"

namespace voxdag::query {

class DagExport {
 public:
  // Uses the members `format`, `options`, `gray`, `replace` and `memory_bytes` of the request, and
  // ignores the others. `file` must outlive this object. Throws Error{kInvalidInput} for options
  // that the format does not have.
  DagExport(const voxdag_reader::File& file, const ExportRequest& request);

  // Like export_dag(), but with this selection and output instead of the request's.
  ExportReport write(FileSystem& files, const Selection& selection, const std::string& output,
                     Progress& progress, const CancelToken& cancel);
  // Compares the complete file with its checksums, at the first call. write() also calls it.
  void verify(Progress& progress, const CancelToken& cancel);
  // True if an export of the selection has contents: a set cell, or for a level set, a set cell at
  // a distance of at most the band's width (level_set/narrow_band.h).
  bool has_contents(const Selection& selection) const;
  const DagView& dag() const { return dag_; }  // in the axes of the file

 private:
  const voxdag_reader::File& file_;
  const ExportRequest request_;
  const AxisTurn turn_;
  MemoryBudget budget_;
  const DagView dag_;
  // Sets filled_ to the filled DAG of the grid with 2^grid_levels cells per edge, unless the last
  // call was for the same grid.
  void fill(const DagView& dag, uint32_t grid_levels, const CancelToken& cancel);
  // Throws Error{kInvalidInput} if the voxels of the complete grid are a surface without an inside,
  // which has no level set. Does nothing after a call that has not thrown.
  void require_inside(const CancelToken& cancel);

  bool is_verified_ = false;         // set by verify()
  bool has_inside_ = false;          // set by require_inside()
  std::optional<TurnedDag> turned_;  // made by the first write() if turn_ changes the axes
  std::optional<FilledDag> filled_;  // filled DAG of the last written grid, for --outside
};

}  // namespace voxdag::query
