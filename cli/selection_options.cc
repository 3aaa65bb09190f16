#include "cli/selection_options.h"

#include <algorithm>
#include <cmath>

namespace voxdag::cli {
namespace {

constexpr uint32_t kMinGridLevels = 2;

uint32_t grid_levels(const SelectionOptions& options, const voxdag_reader::File& file) {
  if (!options.level && !options.resolution) return file.grid_levels();
  const double levels = options.level ? *options.level : std::log2(*options.resolution);
  if (levels != std::floor(levels) || levels < kMinGridLevels || levels > file.grid_levels()) {
    const std::string most = std::to_string(file.grid_levels());
    throw Error(ErrorCode::kInvalidInput,
                options.level ? "--level: expected 2 to " + most + ", the file's own"
                              : "--resolution: expected a power of two from 4 to " +
                                    std::to_string(file.resolution()) + ", the file's own");
  }
  return static_cast<uint32_t>(levels);
}

// The cells that a box in world space touches.
query::Region world_region(const std::string& text, const voxdag_reader::File& file,
                           uint32_t grid_levels) {
  const auto box = parse_list<double, 6>("--region", text, ',', "six numbers X0,Y0,Z0,X1,Y1,Z1");
  const double cells = std::ldexp(1, static_cast<int>(grid_levels));
  query::Region region;
  for (size_t axis = 0; axis < 3; ++axis) {
    const auto cell = [&](double world) {
      return std::clamp((world - file.origin()[axis]) / file.edge() * cells, 0.0, cells);
    };
    // Not a number fails this, too.
    if (!(box[axis] < box[axis + 3]))
      throw Error(ErrorCode::kInvalidInput,
                  "--region '" + text + "': expected the low corner before the high one");
    region.low[axis] = static_cast<int64_t>(std::floor(cell(box[axis])));
    region.high[axis] = static_cast<int64_t>(std::ceil(cell(box[axis + 3])));
  }
  return region;
}

query::Region cell_region(const std::string& text, uint32_t grid_levels) {
  const auto box =
      parse_list<int64_t, 6>("--region", text, ',', "six whole numbers X0,Y0,Z0,X1,Y1,Z1");
  const int64_t edge = int64_t{1} << grid_levels;
  query::Region region;
  for (size_t axis = 0; axis < 3; ++axis) {
    if (box[axis] >= box[axis + 3])
      throw Error(ErrorCode::kInvalidInput,
                  "--region '" + text + "': expected the low corner before the high one");
    region.low[axis] = std::clamp<int64_t>(box[axis], 0, edge);
    region.high[axis] = std::clamp<int64_t>(box[axis + 3], 0, edge);
  }
  return region;
}

}  // namespace

void SelectionOptions::declare(Command& command) {
  const Option region_option = command.option(
      "--region", region,
      "X0,Y0,Z0,X1,Y1,Z1: a half-open box in voxels of the grid that --level selects");
  Option world_flag = command.flag("--world", world, "the region is in scene units");
  world_flag.needs(region_option);
  Option level_option =
      command.option("--level", level, "l: the coarser grid of 2^l voxels per edge");
  const Option resolution_option =
      command.option("--resolution", resolution, "the same by its voxels per edge");
  level_option.excludes(resolution_option);
}

query::Selection SelectionOptions::selection(const voxdag_reader::File& file) const {
  query::Selection selection;
  selection.grid_levels = grid_levels(*this, file);
  selection.region = query::whole_grid(selection.grid_levels);
  if (!region.empty())
    selection.region = world ? world_region(region, file, selection.grid_levels)
                             : cell_region(region, selection.grid_levels);
  if (selection.region.empty())
    throw Error(ErrorCode::kInvalidInput,
                "--region '" + region + "': it lies outside the grid of " +
                    std::to_string(int64_t{1} << selection.grid_levels) + " voxels per edge");
  return selection;
}

}  // namespace voxdag::cli
