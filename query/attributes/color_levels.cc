#include "query/attributes/color_levels.h"

#include <algorithm>
#include <bit>
#include <string>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/dag/brick.h"

namespace voxdag::query {

void check_attribute_options(bool has_attributes, bool has_fill_color, uint64_t color_resolution) {
  if (has_attributes || (!has_fill_color && color_resolution == 0)) return;
  throw Error(ErrorCode::kInvalidInput,
              option_text(has_fill_color ? "fill_color" : "color_resolution") + " and " +
                  option_text("no_attributes") + " were both given: expected one of them");
}

std::string unused_color_resolution() {
  return option_text("color_resolution") +
         " has no effect: the result has no colors and no other attributes";
}

void refuse_color_resolution(const voxdag_reader::File& a, uint64_t cells) {
  if (cells == 0) return;
  if (std::has_single_bit(cells) && cells >= uint64_t{1} << kBrickLevels &&
      cells <= static_cast<uint64_t>(a.resolution()))
    return;
  throw Error(ErrorCode::kInvalidInput,
              option_text("color_resolution") + " " + std::to_string(cells) +
                  ": expected a power of two from 4 to " + std::to_string(a.resolution()));
}

uint32_t color_levels_of(const voxdag_reader::File& a, const std::string& name_of_a,
                         const voxdag_reader::File& b,
                         const std::vector<CombinedAttribute>& attributes, uint64_t limit,
                         Progress& progress) {
  struct Cells {
    const voxdag_reader::File& file;
    const std::string& name;
    int64_t level;
  };
  std::vector<Cells> sources;
  for (const auto& [attribute, from_a, from_b] : attributes) {
    if (from_a) sources.push_back({a, name_of_a, finest_level_of(a, attribute, a.grid_levels())});
    if (from_b) sources.push_back({b, b.path(), finest_level_of(b, attribute, a.grid_levels())});
  }
  int64_t finest = kBrickLevels;
  for (const Cells& cells : sources) finest = std::max(finest, cells.level);
  if (limit > 0) {
    const int64_t level = std::bit_width(limit) - 1;
    for (const Cells& cells : sources)
      if (level < a.grid_levels() - int64_t{cells.file.grid_levels()})
        throw Error(ErrorCode::kInvalidInput,
                    option_text("color_resolution") + " " + std::to_string(limit) +
                        ": a color cell would be larger than " + cells.name +
                        ": expected at least " +
                        std::to_string(a.resolution() / cells.file.resolution()));
    finest = std::min(finest, level);
  }
  const auto edge_text = [&](int64_t level) {
    const int64_t edge = int64_t{1} << (a.grid_levels() - level);
    return std::to_string(edge) + (edge == 1 ? " voxel" : " voxels");
  };
  for (const Cells& cells : sources) {
    if (cells.level >= finest || cells.file.empty() || cells.level < 0) continue;
    const int64_t down = finest - cells.level;
    progress.warn("color cells of " + cells.name + " have an edge of " + edge_text(cells.level) +
                  ", and color cells of the result of " + edge_text(finest) + ": the values of " +
                  cells.name + " can take about " + std::to_string(uint64_t{1} << 2 * down) +
                  " times as many bytes; " + option_text("color_resolution") + " " +
                  std::to_string(uint64_t{1} << std::max<int64_t>(cells.level, kBrickLevels)) +
                  " prevents this");
    break;
  }
  return static_cast<uint32_t>(finest);
}

}  // namespace voxdag::query
