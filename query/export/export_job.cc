#include "query/export/export_job.h"

#include <bit>
#include <charconv>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/text.h"
#include "core/format/global/open_global.h"
#include "query/lookup/bricks.h"
#include "query/lookup/node_counts.h"

namespace voxdag::query {

Selection coarser(const Selection& selection, uint32_t grid_levels) {
  const uint32_t shift = selection.grid_levels - grid_levels;
  Selection coarse{grid_levels, {}};
  for (size_t axis = 0; axis < 3; ++axis) {
    coarse.region.low[axis] = selection.region.low[axis] >> shift;
    coarse.region.high[axis] = ((selection.region.high[axis] - 1) >> shift) + 1;
  }
  return coarse;
}

std::string less_is_needed() {
  return "a smaller " + option_text("region") + " or a coarser " + option_text("level") +
         " needs less";
}

void require_space(const ExportJob& job, uint64_t bytes) {
  const uint64_t free = job.files.free_space(parent_directory(job.output));
  if (bytes > free)
    throw Error(ErrorCode::kNoSpace, job.output + " will have " + size_text(bytes) +
                                         ", but the disk has only " + size_text(free) +
                                         " free: " + less_is_needed());
}

std::string coarser_options(const ExportJob& job, uint32_t grid_levels) {
  std::string text = option_text("level", std::to_string(grid_levels));
  if (job.selects_all_of(job.selection.grid_levels)) return text;
  const Region region =
      job.turn.original(coarser(job.selection, grid_levels).region, int64_t{1} << grid_levels);
  std::string box;
  for (const auto& corner : {region.low, region.high})
    for (const int64_t coordinate : corner)
      box += (box.empty() ? "" : ",") + std::to_string(coordinate);
  return text + " " + option_text("region", box);
}

void refuse_size(const ExportJob& job, const std::string& problem,
                 const std::function<bool(uint32_t grid_levels)>& fits, ErrorCode code) {
  // Tries the coarsest grid first, then finer ones. Testing a grid that does not fit can take long,
  // and in this order only one such grid is tested.
  uint32_t end = kBrickLevels;
  {
    ExportStage stage(job, "find a level that fits", job.selection.grid_levels - end, "levels");
    for (; end < job.selection.grid_levels && fits(end); ++end) {
      stage.advance(1);
      stage.report();
    }
  }
  job.cancel.check();
  const std::string grid = std::to_string(int64_t{1} << (end - 1));
  throw Error(code, job.output + ": " + problem +
                        (end > kBrickLevels ? ". " + coarser_options(job, end - 1) + " (" + grid +
                                                  " voxels per edge) fits, or take a smaller "
                                            : ". Expected a smaller ") +
                        option_text("region"));
}

uint64_t count_voxels(const ExportJob& job, const Selection& selection, uint64_t limit) {
  if (selection.grid_levels == job.dag.grid_levels() &&
      selection.region == whole_grid(selection.grid_levels))
    return job.file.voxels();
  ExportStage stage(job, "count", 0, "voxels");
  uint64_t voxels = 0;
  const auto add = [&](uint64_t more) {
    stage.advance(more);
    return (voxels += more) <= limit;
  };
  for_each_brick_or_full_cube(
      job.dag, selection,
      [&](const Brick& brick) { return add(static_cast<uint64_t>(std::popcount(brick.mask))); },
      [&](const Position&, int64_t edge) { return add(cells_of_cube(edge)); });
  return voxels;
}

CellLimit::CellLimit(const ExportJob& job, uint64_t limit) : job_(job), limit_(limit) {
  if (job.selects_all_of(job.selection.grid_levels))
    cells_.emplace(job.file, job.dag, job.budget, job.cancel);
}

bool CellLimit::fits(uint32_t grid_levels) {
  job_.cancel.check();
  try {
    if (cells_) return cells_->count(grid_levels, limit_) <= limit_;
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kOutOfMemory) throw;
    cells_.reset();
  }
  const Selection selection = coarser(job_.selection, grid_levels);
  const NodeCounts counts(job_.file, job_.dag, grid_levels, job_.budget, job_.cancel);
  if (counts.is_stored()) return counts.count(selection.region) <= limit_;
  CancelCheck check(job_);
  uint64_t voxels = 0;
  const auto add = [&](uint64_t more) {
    check.advance(1);
    return (voxels += more) <= limit_;
  };
  for_each_brick_or_full_cube(
      job_.dag, selection,
      [&](const Brick& brick) { return add(static_cast<uint64_t>(std::popcount(brick.mask))); },
      [&](const Position&, int64_t edge) { return add(cells_of_cube(edge)); });
  return voxels <= limit_;
}

std::string damage_text() {
  const std::string verify = command_text("verify");
  return "the file is damaged" + (verify.empty() ? "" : " (" + verify + " reports where)");
}

void refuse_empty(const ExportJob& job) {
  throw Error(
      ErrorCode::kInvalidInput,
      job.file.path() + (job.file.empty() ? ": the file has no voxels: expected a file with voxels"
                                          : ": no voxels are selected: expected a " +
                                                option_text("region") + " with voxels"));
}

void require_written(const ExportJob& job, uint64_t written, uint64_t expected) {
  if (written != expected)
    throw Error(ErrorCode::kCorrupt, job.file.path() + ": " + count_text(written) +
                                         " voxels were found, expected " + count_text(expected) +
                                         ": " + damage_text());
}

voxdag_reader::Rgb color_of_cell(const ExportJob& job, voxdag_reader::ColorCursor& colors,
                                 const std::array<int64_t, 3>& turned_cell) {
  const Position cell = job.original(turned_cell);
  const auto color = with_reader_errors(
      [&] { return colors.color(cell[0], cell[1], cell[2], job.selection.grid_levels); });
  if (!color)
    throw Error(ErrorCode::kCorrupt,
                job.file.path() + ": " + cell_text(job, cell) + " has no color: " + damage_text());
  return *color;
}

std::string cell_text(const ExportJob& job, const std::array<int64_t, 3>& cell) {
  return "cell " + std::to_string(cell[0]) + " " + std::to_string(cell[1]) + " " +
         std::to_string(cell[2]) + " of level " + std::to_string(job.selection.grid_levels);
}

uint64_t require_voxels(const ExportJob& job, uint64_t limit, const std::string& reason) {
  const uint64_t voxels = count_voxels(job, job.selection, limit);
  if (voxels == 0) refuse_empty(job);
  if (voxels <= limit) return voxels;
  const bool exact = job.selects_all_of(job.dag.grid_levels());
  CellLimit cells(job, limit);
  refuse_size(job,
              (exact ? "" : "over ") + count_text(exact ? voxels : limit) +
                  " voxels are selected, but " + reason + " at most " + count_text(limit),
              [&](uint32_t level) { return cells.fits(level); });
}

}  // namespace voxdag::query
