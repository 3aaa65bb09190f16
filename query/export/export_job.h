// ExportJob, the inputs that every format's writer gets, and functions that the writers share.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/memory_budget.h"
#include "core/format/global/watched_file.h"
#include "query/dag/dag_view.h"
#include "query/export/export.h"
#include "query/export/export_file.h"
#include "query/export/level_cells.h"
#include "query/export/turn/axis_turn.h"

namespace voxdag::query {

struct ExportJob {
  FileSystem& files;
  const voxdag_reader::File& file;
  const DagView& dag;  // the file's DAG in turned axes (axis_turn.h); not empty
  const WatchedFile& watched;
  const std::function<void()>& verify;  // compares the file with its checksums
  Selection selection;                  // in turned axes
  std::string output;
  std::string second_output;  // name of the second file, for formats with two files
  bool has_colors;            // write colors, if the format supports them
  MemoryBudget& budget;
  Progress& progress;
  const CancelToken& cancel;
  AxisTurn turn;
  ExportOptions options;
  // With options.outside: the DAG of the selection's grid with its enclosed space filled
  // (filled_dag.h).
  const DagView* filled = nullptr;

  // Returns the world coordinate of the grid's low corner along an axis of the turned grid.
  double origin(size_t axis) const {
    const double low = file.origin()[turn.from[axis]];
    return turn.reversed[axis] ? -(low + file.edge()) : low;
  }
  // Converts a cell from turned axes to the axes of the file.
  Position original(const Position& cell) const {
    return turn.is_none() ? cell : turn.original(cell, int64_t{1} << selection.grid_levels);
  }
  // Returns the edge of a cell of the selected grid in world space.
  double cell_edge() const {
    return file.edge() / static_cast<double>(int64_t{1} << selection.grid_levels);
  }
  // Returns the world coordinate of a position along an axis; `cells` is the position in cells.
  double world(size_t axis, double cells) const { return origin(axis) + cells * cell_edge(); }
  bool selects_all_of(uint32_t grid_levels) const {
    return selection.grid_levels == grid_levels && selection.region == whole_grid(grid_levels);
  }
};

// Reports a stage of the export's progress. The stage "export", which every format has, first
// compares the input file with its checksums. It comes after the checks of limits, because a format
// that cannot store a huge file must refuse it without reading it. Some formats read the file
// earlier, and then report other errors first. Every 4096th call of
// advance() reports, and checks for cancellation. The destructor ends the stage.
class ExportStage {
 public:
  ExportStage(const ExportJob& job, std::string_view name, uint64_t total, std::string_view unit)
      : job_(job) {
    if (name == "export") job.verify();
    job.progress.begin_stage(name, total, unit);
  }
  ExportStage(const ExportStage&) = delete;
  ExportStage& operator=(const ExportStage&) = delete;
  ~ExportStage() {
    job_.progress.advance(pending_);
    job_.progress.end_stage();
  }
  void advance(uint64_t count) {
    pending_ += count;
    if (++calls_ % kCallsPerCheck == 0) report();
  }
  // Reports the progress immediately.
  void report() {
    job_.cancel.check();
    job_.progress.advance(pending_);
    pending_ = 0;
  }

 private:
  static constexpr uint64_t kCallsPerCheck = 4096;
  const ExportJob& job_;
  uint64_t pending_ = 0, calls_ = 0;
};

// Checks for cancellation in a long loop without an ExportStage, once per kCallsPerCheck calls of
// advance().
class CancelCheck {
 public:
  explicit CancelCheck(const ExportJob& job) : job_(job) {}
  void advance(uint64_t) {
    if (++calls_ % kCallsPerCheck == 0) job_.cancel.check();
  }

 private:
  static constexpr uint64_t kCallsPerCheck = 65536;
  const ExportJob& job_;
  uint64_t calls_ = 0;
};

// Returns the same part of the file on a coarser grid.
Selection coarser(const Selection& selection, uint32_t grid_levels);
// Returns options that select the same part of the scene on a coarser grid, for messages:
// "--level 11" on the command line, followed by "--region" if the job does not select the complete
// grid. The region is in cells of the coarser grid and in the axes of the file.
std::string coarser_options(const ExportJob& job, uint32_t grid_levels);

// Publishes the files and returns their total size in bytes. If a read of the input file has failed
// (watched_file.h), throws Error{kIo} instead.
inline uint64_t publish(const ExportJob& job, std::span<ExportFile* const> written) {
  job.watched.check_readable();
  return ExportFile::publish(written);
}

// Returns advice for messages: "a smaller --region or a coarser --level needs less".
std::string less_is_needed();

// Throws Error{kNoSpace} if the disk of the output has less than `bytes` free.
void require_space(const ExportJob& job, uint64_t bytes);

// Throws Error{code} with a message such as "OUTPUT: PROBLEM. --level 11 fits", where 11 is the
// finest of the coarser levels that fit. If no coarser level fits, the message ends with "Expected
// a smaller --region". fits(grid_levels) returns true if the selection fits on that coarser grid.
[[noreturn]] void refuse_size(const ExportJob& job, const std::string& problem,
                              const std::function<bool(uint32_t grid_levels)>& fits,
                              ErrorCode code = ErrorCode::kLimit);

// Returns the number of set cells of `selection`. Stops counting above `limit`: the result is then
// an arbitrary number over `limit`.
uint64_t count_voxels(const ExportJob& job, const Selection& selection, uint64_t limit);
// Determines on which coarser grids the job's selection has at most `limit` set cells. Call fits()
// for the coarsest grid first, then for finer grids. Counts the cells in the first of these ways
// that is possible:
// 1. If the complete grid is selected, LevelCells reads each level once for all calls together.
//    It needs memory for the nodes of two levels.
// 2. NodeCounts reads each node once per call. It needs memory for a count per node.
// 3. Otherwise, each call visits all bricks of the selection.
class CellLimit {
 public:
  CellLimit(const ExportJob& job, uint64_t limit);
  bool fits(uint32_t grid_levels);

 private:
  const ExportJob& job_;
  const uint64_t limit_;
  std::optional<LevelCells> cells_;  // set if the complete grid is selected and memory suffices
};

// Returns the number of set cells of the job's selection. If this number is over `limit`, throws
// Error{kLimit} like refuse_size(). `reason` begins the message's explanation of the limit, such as
// "readers of PLY take". Throws Error{kInvalidInput} for a selection without set cells.
uint64_t require_voxels(const ExportJob& job, uint64_t limit, const std::string& reason);

[[noreturn]] void refuse_empty(const ExportJob& job);

// Throws Error{kCorrupt} unless `written`, the number of voxels that a writer has found, equals
// `expected`, the number of voxels in the file's header or from an earlier count.
void require_written(const ExportJob& job, uint64_t written, uint64_t expected);
// Returns the end of a message about a damaged file: the command that reports the damage, if the
// users have one.
std::string damage_text();
// Returns the name of a cell of the selection's grid, for messages.
std::string cell_text(const ExportJob& job, const std::array<int64_t, 3>& cell);
// Returns the color of a cell of the selected grid. The cell must be set and is in turned axes.
// Throws Error{kCorrupt} if it has no color.
voxdag_reader::Rgb color_of_cell(const ExportJob& job, voxdag_reader::ColorCursor& colors,
                                 const std::array<int64_t, 3>& turned_cell);

// The writers, one per format. A writer that needs a missing library is not defined.
ExportReport write_ply(const ExportJob& job);
ExportReport write_npz(const ExportJob& job);
ExportReport write_hashdag(const ExportJob& job);
ExportReport write_svdag(const ExportJob& job);
ExportReport write_voxel(const ExportJob& job);
ExportReport write_vox(const ExportJob& job);
ExportReport write_bt(const ExportJob& job);
ExportReport write_ot(const ExportJob& job);
ExportReport write_glb(const ExportJob& job);
// Like write_glb(), with a different limit of the file's size in bytes. Tests use a small limit,
// because writing files of 4 GiB takes too long.
ExportReport write_glb_within(const ExportJob& job, uint64_t max_bytes);
ExportReport write_vtu(const ExportJob& job);
ExportReport write_inp(const ExportJob& job);
ExportReport write_vdb(const ExportJob& job);
ExportReport write_nvdb(const ExportJob& job);

}  // namespace voxdag::query
