// Combines two files with colors, and compares the colors of the result with colors that are
// computed voxel by voxel from the scenes. Code written from docs/format.md decodes the combined
// file.
#pragma once

#include <cmath>
#include <optional>

#include "core/color/color_of.h"
#include "tests/unit/core/format/color/valued_files.h"
#include "tests/unit/query/combine/combine_fixture.h"
#include "voxdag/cells.h"

namespace voxdag::query {

class CombineColors : public Combine {
 protected:
  static Position position_of(uint64_t code) {
    uint32_t x, y, z;
    morton_decode(code, x, y, z);
    return {x, y, z};
  }
  static uint64_t code_of(const Position& at) {
    return morton_encode(static_cast<uint32_t>(at[0]), static_cast<uint32_t>(at[1]),
                         static_cast<uint32_t>(at[2]));
  }
  static double linear_of(int stored) {
    const double s = stored / 255.0;
    return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
  }
  static double stored_of(double linear) {
    return 255 * (linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055);
  }

  // Each cell has one of two grays. The grays of the two files differ. Color blocks encode all four
  // grays well.
  static constexpr int kGrays[2][2] = {{0, 85}, {170, 255}};
  static constexpr int kTolerance = 40;
  static int gray_of(size_t file, uint64_t code) {
    return kGrays[file][oracle::Random(code).between(0, 1)];
  }
  static SumOf grays(size_t file) {
    return [=](uint64_t code) {
      const uint64_t gray = color::intensity_of(static_cast<uint8_t>(gray_of(file, code)));
      ColorSum sum;
      sum.plain = sum.seen = {gray, gray, gray};
      sum.weight = sum.seen_weight = 1;
      return sum;
    };
  }

  // Writes the files a and b, whose voxels have the edge 1. If their grids are equally large, half
  // of the random voxels are in both files.
  void write(uint32_t levels_a, uint32_t color_a, uint32_t levels_b, uint32_t color_b,
             int count = 1500) {
    scenes_[0] = {levels_a, color_a, random_codes(21, levels_a, count), grays(0)};
    scenes_[1] = {levels_b, color_b, random_codes(22, levels_b, count), grays(1)};
    if (levels_a == levels_b)
      for (const uint64_t code : random_codes(23, levels_a, count))
        for (ColoredScene& scene : scenes_) scene.voxels.push_back(code);
    for (ColoredScene& scene : scenes_) {
      std::sort(scene.voxels.begin(), scene.voxels.end());
      const auto end = std::unique(scene.voxels.begin(), scene.voxels.end());
      scene.voxels.erase(end, scene.voxels.end());
    }
    write_file(0, true);
    write_file(1, true);
  }
  static std::string name(size_t file) { return file == 0 ? "a" : "b"; }
  void write_file(size_t file, bool with_colors) const {
    const ColoredScene& scene = scenes_[file];
    const oracle::Dag dag = sparse_dag(scene.voxels, scene.levels);
    GlobalFileWriter writer(
        system_files(), path(name(file)),
        Grid::given({0, 0, 0}, static_cast<double>(1 << scene.levels), scene.levels), 64);
    write_levels(writer, dag, scene.levels);
    if (with_colors) write_colors(writer, scene);
    writer.finish({dag.voxels, dag.svo_nodes});
  }

  // Returns the voxels of the result, in the grid of a.
  Codes result_voxels(const CombineSpec& spec) const {
    const Position offset = spec.offset.value_or(Position{});
    const int64_t edge = int64_t{1} << scenes_[0].levels;
    std::map<uint64_t, int> files;  // bit f: the voxel is in file f
    for (const uint64_t code : scenes_[0].voxels) files[code] |= 1;
    for (const uint64_t code : scenes_[1].voxels) {
      Position at = position_of(code);
      bool is_inside = true;
      for (size_t axis = 0; axis < 3; ++axis) {
        at[axis] += offset[axis];
        is_inside = is_inside && at[axis] >= 0 && at[axis] < edge;
      }
      if (is_inside) files[code_of(at)] |= 2;
    }
    Codes voxels;
    for (const auto& [code, in] : files) {
      const bool a = in & 1, b = in & 2;
      const bool is_set[] = {a || b, a && !b, a && b, a != b};
      if (is_set[static_cast<int>(spec.operation)]) voxels.push_back(code);
    }
    return voxels;
  }

  // Returns the code of the cell of b's color grid from which the result's cell at `code` takes its
  // color. Returns nullopt if the moved b has no voxel in the result's cell. The result has cells
  // of `edge` voxels.
  std::optional<uint64_t> color_cell_of_b(uint64_t code, int64_t edge, const Position& offset) {
    const ColoredScene& b = scenes_[1];
    if (cells_of_b_.empty())
      for (const uint64_t voxel : b.voxels) {
        Position at = position_of(voxel);
        cells_of_b_.insert({at[0] / edge, at[1] / edge, at[2] / edge});
        for (size_t axis = 0; axis < 3; ++axis) at[axis] += offset[axis];
        if (std::ranges::all_of(at, [](int64_t i) { return i >= 0; }))
          cells_with_b_.insert({at[0] / edge, at[1] / edge, at[2] / edge});
      }
    if (!cells_with_b_.contains(position_of(code))) return std::nullopt;
    const Position low = position_of(code);
    int64_t largest = 0;
    Position best = {};
    for (const Position& cell : cells_of_b_) {  // in the order of x, y and z
      int64_t overlap = 1;
      for (size_t axis = 0; axis < 3; ++axis) {
        const int64_t begin = cell[axis] * edge + offset[axis];
        const int64_t common =
            std::min(begin, low[axis] * edge) + edge - std::max(begin, low[axis] * edge);
        overlap *= std::max<int64_t>(common, 0);
      }
      if (overlap > largest) {
        largest = overlap;
        best = cell;
      }
    }
    const int64_t color_edge = int64_t{1} << (b.levels - b.color_levels);
    for (int64_t& i : best) i = i * edge / color_edge;
    return code_of(best);
  }

  // Combines the files, and compares the color of each cell of each level. `fill` is the gray of
  // cells without a color; `has_color` tells which files have colors.
  void check(const CombineSpec& spec, uint32_t color_levels,
             std::array<bool, 2> has_color = {true, true}, int fill = -1) {
    SCOPED_TRACE(testing::Message() << "operation " << static_cast<int>(spec.operation)
                                    << ", color levels " << color_levels);
    const ColoredScene& a = scenes_[0];
    const ColoredScene result{a.levels, color_levels, result_voxels(spec), {}};
    ASSERT_FALSE(result.voxels.empty());
    combine_files("a", "b", spec);
    const std::string written = bytes("c");
    const SectionDecoder decoder(written, result);
    const int64_t edge = int64_t{1} << (a.levels - color_levels);
    std::set<uint64_t> cells_of_a;
    for (const uint64_t voxel : a.voxels) cells_of_a.insert(voxel >> 3 * (a.levels - color_levels));
    cells_of_b_.clear();
    cells_with_b_.clear();
    // By level and cell: the sum of the linear intensities of the finest cells, and their number.
    std::map<std::pair<uint32_t, uint64_t>, std::pair<double, double>> means;
    for (const uint64_t code : result.cells(color_levels)) {
      int gray = fill;
      if (has_color[0] && cells_of_a.contains(code)) {
        const uint32_t up = color_levels - std::min(color_levels, a.color_levels);
        gray = gray_of(0, code >> 3 * up);
        ++from_a_;
      } else if (const auto cell =
                     has_color[1] ? color_cell_of_b(code, edge, spec.offset.value_or(Position{}))
                                  : std::nullopt) {
        gray = gray_of(1, *cell);
        ++from_b_;
      } else {
        ++filled_;
      }
      ASSERT_GE(gray, 0);
      for (uint32_t level = 0; level <= color_levels; ++level) {
        auto& [sum, count] = means[{level, code >> 3 * (color_levels - level)}];
        sum += linear_of(gray);
        count += 1;
      }
    }
    ASSERT_EQ(means.size(), decoder.colors().size());
    for (const auto& [place, mean] : means)
      for (const int channel : decoder.colors().at(place))
        ASSERT_NEAR(channel, stored_of(mean.first / mean.second), kTolerance)
            << place.first << " " << place.second;
  }

  ColoredScene scenes_[2];
  std::set<Position> cells_of_b_;    // cubes of b's grid that have voxels
  std::set<Position> cells_with_b_;  // cells of the result that have voxels of the moved b
  size_t from_a_ = 0, from_b_ = 0, filled_ = 0;
};

}  // namespace voxdag::query
