// Measures how close the colors of a file are to the scene's colors. For a sample of the file's
// cells, it compares both the color by voxdag's color rule and the color stored in the file with
// the oracle's color (tests/oracle/surface_color.h). Prints peak signal-to-noise ratios.
//
//     bench_color_quality [--cells N] [--points N] SCENE FILE.vdag
//
// --cells: the approximate number of cells that are compared (default: 200000).
// --points: the number of points of a cell that the oracle samples (default: 128).
#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <string>
#include <vector>

#include "bench/color_quality/sampled_cells.h"
#include "bench/color_quality/scene_looks.h"
#include "core/base/error.h"
#include "core/color/color_of.h"
#include "core/color/rule/bake_region.h"
#include "core/format/global/open_global.h"
#include "scene/formats/formats.h"
#include "scene/textures/texture_set.h"

namespace voxdag {
namespace {

constexpr uint64_t kMemoryBytes = uint64_t{16} << 30;

struct Arguments {
  uint64_t cells = 200000;
  int points = 128;
  std::vector<std::string> files;
};

// For each sampled cell, the triangles that touch it or are near it.
struct Neighborhood {
  std::vector<FixedSurface> surfaces;
  std::vector<std::vector<uint32_t>> near;  // for each cell, the indices of the surfaces near it
};

Neighborhood find_surfaces(TriangleSource& scene, const Grid& grid, const SampledCells& cells) {
  Neighborhood found;
  found.near.resize(cells.positions().size());
  std::vector<uint32_t> touched;
  const auto cursor = scene.open(1);
  cursor->read_surfaces(0, scene.declared_triangles(), [&](std::span<const SurfaceTriangle> batch) {
    for (const SurfaceTriangle& triangle : batch) {
      FixedSurface surface;
      if (snap_triangle(grid, triangle.position, surface.position) != SnapResult::kInside) continue;
      surface.corners = triangle.corners;
      surface.material = triangle.material;
      touched.clear();
      cells.find_near(surface.position, touched);
      if (touched.empty()) continue;
      for (const uint32_t cell : touched)
        found.near[cell].push_back(static_cast<uint32_t>(found.surfaces.size()));
      found.surfaces.push_back(surface);
    }
  });
  return found;
}

// Computes the color of one cell by voxdag's color rule.
class RuleColors {
 public:
  RuleColors(const ColorGrid& grid, const TextureSet& textures, TextureReader& reader)
      : grid_(grid), baker_(grid, textures.materials(), reader) {}
  std::array<uint8_t, 3> color(const CellPosition& cell, std::span<const FixedSurface> near) {
    baker_.bake({grid_.color_levels, {cell[0], cell[1], cell[2]}}, near, baked_);
    if (baked_.size() != 1)
      throw Error(ErrorCode::kInvalidInput, "nothing of the scene touches a cell of the file");
    return color_of(baked_[0].sum).rgb;
  }

 private:
  const ColorGrid grid_;
  RegionBaker<TextureReader> baker_;
  std::vector<ColoredCell> baked_;
};

void print(const char* what, const oracle::ColorError& error) {
  std::printf("  %-28s %6.2f dB   more than 48 off: %.3f %%\n", what, error.psnr(),
              100 * error.part_above(48));
}

double bits_per_cell(const voxdag_reader::File& file, uint64_t cells) {
  uint64_t bytes = 0;
  for (uint32_t t = 0; t < file.colors().tier_count(); ++t)
    bytes += 16 * file.colors().tier(t).units + 32 * file.colors().tier(t).region_count;
  return 8 * static_cast<double>(bytes) / static_cast<double>(cells);
}

void compare(const Arguments& arguments) {
  const auto file = open_global_file(arguments.files[1]);
  if (!file->has_colors())
    throw Error(ErrorCode::kInvalidInput, arguments.files[1] + " has no colors");
  MemoryBudget budget(kMemoryBytes);
  NoProgress progress;
  const CancelToken cancel;
  const auto scene = open_scene(system_files(), {arguments.files[0]}, {}, budget, cancel);
  const SceneMaterials materials = scene->materials();
  const SampledCells cells(*file, arguments.cells);
  const Grid grid = grid_of(*file);
  const Neighborhood found = find_surfaces(*scene, grid, cells);
  const SceneLooks looks(materials, budget);
  std::vector<oracle::Surface> surfaces;
  for (const FixedSurface& surface : found.surfaces) surfaces.push_back(looks.surface(surface));

  const auto textures = TextureSet::prepare(
      system_files(), materials, arguments.files[1] + ".images", 1, budget, progress, cancel);
  const auto reader = textures->open(uint64_t{256} << 20);
  RuleColors rule({file->grid_levels(), file->color_levels()}, *textures, *reader);
  voxdag_reader::ColorCursor stored(*file);
  oracle::ColorError of_rule, of_file, of_blocks;
  uint64_t without_area = 0;
  std::vector<const oracle::Surface*> near;
  std::vector<FixedSurface> near_fixed;
  const int64_t edge = int64_t{1} << cells.cell_bits();
  for (size_t i = 0; i < cells.positions().size(); ++i) {
    const CellPosition& cell = cells.positions()[i];
    near.clear();
    near_fixed.clear();
    for (const uint32_t s : found.near[i]) {
      near.push_back(&surfaces[s]);
      near_fixed.push_back(found.surfaces[s]);
    }
    const auto mean = oracle::mean_color(near, {cell[0] * edge, cell[1] * edge, cell[2] * edge},
                                         edge, arguments.points);
    const auto by_rule = rule.color(cell, near_fixed);
    const auto in_file = stored.color(cell[0], cell[1], cell[2], file->color_levels());
    if (!in_file) file->broken_section(file->colors(), "a cell has no color");
    of_blocks.add(by_rule, {in_file->r, in_file->g, in_file->b});
    if (!mean) {
      ++without_area;
      continue;
    }
    of_rule.add(*mean, by_rule);
    of_file.add(*mean, {in_file->r, in_file->g, in_file->b});
  }
  std::printf("%s: %" PRIu64 "^3, %" PRIu64 " cells, %zu compared, %" PRIu64
              " without area; %.1f M texels; %.2f bits per cell\n",
              arguments.files[1].c_str(), uint64_t{1} << file->color_levels(), cells.file_cells(),
              cells.positions().size(), without_area, static_cast<double>(looks.texels()) / 1e6,
              bits_per_cell(*file, cells.file_cells()));
  print("rule, against the oracle", of_rule);
  print("file, against the oracle", of_file);
  print("file, against the rule", of_blocks);
}

}  // namespace
}  // namespace voxdag

int main(int argc, char** argv) {
  voxdag::Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const bool has_value = i + 1 < argc;
    if (std::strcmp(argv[i], "--cells") == 0 && has_value)
      arguments.cells = std::strtoull(argv[++i], nullptr, 10);
    else if (std::strcmp(argv[i], "--points") == 0 && has_value)
      arguments.points = std::atoi(argv[++i]);
    else
      arguments.files.emplace_back(argv[i]);
  }
  if (arguments.files.size() != 2 || arguments.points < 1) {
    std::fprintf(stderr, "usage: %s [--cells N] [--points N] SCENE FILE.vdag\n", argv[0]);
    return 2;
  }
  try {
    voxdag::compare(arguments);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
  return 0;
}
