#include "cli/selection_options.h"

#include <bit>

#include "core/base/process_limits.h"
#include "core/base/text.h"

namespace voxdag::cli {
namespace {

constexpr uint32_t kMinGridLevels = 2;

uint32_t grid_levels(const SelectionOptions& options, const voxdag_reader::File& file) {
  if (options.level) {
    if (*options.level < kMinGridLevels || *options.level > file.grid_levels())
      throw Error(ErrorCode::kInvalidInput,
                  "--level " + std::to_string(*options.level) + ": expected 2 to " +
                      std::to_string(file.grid_levels()) + ", the level of the file");
    return static_cast<uint32_t>(*options.level);
  }
  if (!options.resolution) return file.grid_levels();
  const uint64_t cells = *options.resolution;
  if (!std::has_single_bit(cells) || cells < uint64_t{1} << kMinGridLevels ||
      cells > static_cast<uint64_t>(file.resolution()))
    throw Error(ErrorCode::kInvalidInput,
                "--resolution " + std::to_string(cells) + ": expected a power of two from 4 to " +
                    std::to_string(file.resolution()) + ", the resolution of the file");
  return static_cast<uint32_t>(std::countr_zero(cells));
}

[[noreturn]] void refuse_order(const std::string& text) {
  throw Error(ErrorCode::kInvalidInput,
              "--region '" + text + "': expected X0 < X1, Y0 < Y1 and Z0 < Z1");
}

query::Region world_region(const std::string& text, const voxdag_reader::File& file,
                           uint32_t grid_levels) {
  const auto box = parse_list<double, 6>("--region", text, ',', "six numbers X0,Y0,Z0,X1,Y1,Z1");
  // Also refuses NaN, for which the comparison is false.
  for (size_t axis = 0; axis < 3; ++axis)
    if (!(box[axis] < box[axis + 3])) refuse_order(text);
  return query::cut_to_grid(query::world_to_region(file, grid_levels, box), grid_levels);
}

query::Region cell_region(const std::string& text, uint32_t grid_levels) {
  const auto box =
      parse_list<int64_t, 6>("--region", text, ',', "six whole numbers X0,Y0,Z0,X1,Y1,Z1");
  for (size_t axis = 0; axis < 3; ++axis)
    if (box[axis] >= box[axis + 3]) refuse_order(text);
  return query::cut_to_grid({{box[0], box[1], box[2]}, {box[3], box[4], box[5]}}, grid_levels);
}

}  // namespace

uint64_t memory_limit(const std::string& text) {
  const uint64_t bytes = text.empty() ? default_memory() : parse_size(text, "--memory");
  if (bytes < kMinMemory)
    throw Error(ErrorCode::kInvalidInput,
                "--memory " + (text.empty() ? "(default) " + size_text(bytes) : text) +
                    ": expected at least 64MiB");
  return bytes;
}

std::string work_prefix(const std::string& path, const std::string& work) {
  if (work.empty()) return path + ".work-";
  return work + "/" + path.substr(path.rfind('/') + 1) + ".work-";
}

void SelectionOptions::declare(Command& command) {
  const Option region_option = command.option(
      "--region", region,
      "X0,Y0,Z0,X1,Y1,Z1: a half-open box in voxels of the grid that --level selects");
  Option world_flag = command.flag("--world", world, "the region is in scene units");
  world_flag.needs(region_option);
  Option level_option =
      command.option("--level", level, "l: the coarser grid of 2^l voxels per edge");
  const Option resolution_option = command.edge_option(
      "--resolution", [this](uint64_t edge) { resolution = edge; },
      "the same by its voxels per edge, such as 4096 or 4k");
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
    throw Error(ErrorCode::kInvalidInput, "--region '" + region + "' is outside the grid of " +
                                              std::to_string(int64_t{1} << selection.grid_levels) +
                                              " voxels per edge: expected a region that "
                                              "overlaps the grid");
  return selection;
}

}  // namespace voxdag::cli
