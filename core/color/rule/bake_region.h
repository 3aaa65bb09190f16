// What the surfaces in a region of the color grid look like: the rule of docs/color.md. The sum of
// a cell is a function of the triangles that touch it, of their materials and of the images,
// whatever the order of the triangles, and whichever region that contains the cell is baked.
//
// `Textures` is a reader of images, linear and with 16 bits per channel, as pyramids of
// box-filtered levels, the first one being the image:
//     uint32_t levels(uint32_t image), width(uint32_t image, uint32_t level), height(...);
//     View view(uint32_t image, uint32_t level);
// with the members of View, which refers to a level,
//     uint32_t width(), height();
//     uint64_t texel(uint32_t x, uint32_t y);  // r lowest, then g, b, a
//     void prefetch(uint32_t x, uint32_t y);
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/color/color_sum.h"
#include "core/color/rule/cell_triangle.h"
#include "core/color/rule/closest_point.h"
#include "core/color/rule/color_grid.h"
#include "core/color/rule/covered_surface.h"
#include "core/color/rule/region_cells.h"
#include "core/color/rule/surface_look.h"
#include "core/color/rule/touched_cells.h"
#include "core/color/surface.h"
#include "core/geometry/cube.h"
#include "core/geometry/morton.h"
#include "core/geometry/octree_descent.h"

namespace voxdag {

// Bakes one region after another, for one thread; the memory is used again.
template <class Textures>
class RegionBaker {
 public:
  // At most what it has allocated, `cells` not counted.
  static constexpr uint64_t kMaxBytes = color::RegionCells::kMaxBytes + (uint64_t{1} << 20);
  // At most, of the cells of a region that a triangle touches: 4 where its shadow covers one.
  static constexpr uint32_t kTriangleCells = 4u << (2 * kRegionLevels);

  // The references must outlive it. Each triangle's material is an index into `materials`.
  // `wanted`: which values finish() is to find besides colors. Materials are then those of the
  // materials' numbers.
  RegionBaker(const ColorGrid& grid, std::span<const Material> materials, Textures& textures,
              const AttributeSet& wanted = {})
      : grid_(grid), materials_(materials), textures_(textures), cells_(wanted) {
    waiting_.reserve(kMaxWaiting);
    for (int a = 0; a < 3; ++a)
      for (uint32_t k = 0; k < 64; ++k)
        spread_[a][k] = static_cast<uint32_t>(spread_bits3(k) << (2 - a));
  }

  // `region`: a cube of at most 64^3 color cells. `triangles`: all that may touch it, and at most
  // 2^32. `cells` becomes the cells that they touch, in Morton order.
  void bake(const Cube& region, std::span<const FixedSurface> triangles,
            std::vector<ColoredCell>& cells) {
    begin(region);
    add(triangles);
    finish(cells);
  }

  // The same for triangles that come in any number of parts; `max_cells` may stop add().
  void begin(const Cube& region, uint32_t max_cells = color::RegionCells::kMaxCells) {
    max_cells_ = max_cells;
    cells_.reserve(std::min(max_cells + kTriangleCells, color::RegionCells::kMaxCells));
    const uint32_t down = grid_.color_levels - region.level;
    for (int a = 0; a < 3; ++a) {
      first_[a] = static_cast<int64_t>(region.position[a]) << down;
      last_[a] = first_[a] + (int64_t{1} << down) - 1;
    }
  }
  // False: they touch more cells than they may, by up to kTriangleCells, and finish() gives no
  // colors, but must be called.
  bool add(std::span<const FixedSurface> triangles) {
    triangles_ = triangles;
    for (uint32_t i = 0; i < triangles.size() && cells_.count() <= max_cells_; ++i) add_triangle(i);
    add_waiting();
    return cells_.count() <= max_cells_;
  }
  // The same in parts; after each, charge(bytes) gets what the sums for `wanted` have allocated,
  // which is up to 16 MiB more than after the one before, and stops add() if it returns false.
  template <class Charge>
  bool add(std::span<const FixedSurface> triangles, const Charge& charge) {
    constexpr size_t kAtOnce = 16;
    if (!cells_.attributes().is_needed()) return add(triangles);
    bool are_all = true;
    for (size_t at = 0; are_all && at < triangles.size(); at += kAtOnce) {
      are_all = add(triangles.subspan(at, std::min(kAtOnce, triangles.size() - at))) &&
                charge(cells_.attributes().bytes());
    }
    return are_all;
  }
  void finish(std::vector<ColoredCell>& cells) { finish(cells, values_); }
  // `values`: one for each cell if normals or materials are wanted.
  void finish(std::vector<ColoredCell>& cells, std::vector<CellValues>& values) {
    cells_.take(cells, values);
  }

 private:
  static constexpr size_t kMaxWaiting = 1 << 16;
  // A triangle that touches a cell and covers no column of it.
  struct Waiting {
    uint32_t triangle, code;
  };

  void add_triangle(uint32_t index) {
    const FixedTriangle& triangle = triangles_[index].position;
    const CellBox box(triangle, grid_.levels, grid_.color_levels);
    for (int a = 0; a < 3; ++a)
      if (box.high[a] < first_[a] || box.low[a] > last_[a]) return;
    if (box.low[0] == box.high[0] && box.low[1] == box.high[1] && box.low[2] == box.high[2] &&
        !may_cover(triangle)) {
      wait(index, code_of(box.low));
    } else if (color::is_narrow(triangle)) {
      add_in<int64_t>(index, box);
    } else {
      add_in<int128>(index, box);
    }
  }

  // False if the triangle's box has no columns of any two axes: most tiny triangles.
  bool may_cover(const FixedTriangle& triangle) const {
    const int bits = grid_.cell_bits() - 2;
    const int64_t half = int64_t{1} << (bits - 1);
    int axes = 0;
    for (int a = 0; a < 3; ++a)
      axes += (triangle.low(a) + half - 1) >> bits != (triangle.high(a) + half) >> bits;
    return axes >= 2;
  }

  template <class Int>
  void add_in(uint32_t index, const CellBox& box) {
    const FixedSurface& surface = triangles_[index];
    const color::CellTriangle<Int> triangle(surface.position, grid_.cell_bits());
    color::CellRange range;
    for (int d = 0; d < 3; ++d) {
      const int a = triangle.axis[d];
      range.first[d] = std::max(box.low[a], first_[a]);
      range.last[d] = std::min(box.high[a], last_[a]);
    }
    const color::CoveredSurface<Int> covered(triangle);
    std::optional<color::SurfaceLook<Textures>> look;
    std::optional<color::SurfaceFacing> facing;
    // Cells are collected, so that they are on their way from memory while others are found.
    constexpr size_t kBatch = 32;
    struct {
      int64_t p, q;
      uint32_t columns, cell, weight;
      typename color::SurfaceLook<Textures>::Spot spot;
    } batch[kBatch];
    size_t collected = 0;
    const auto add_batch = [&] {
      if (collected == 0) return;
      if (!look)
        look.emplace(surface, materials_[surface.material], textures_, triangle.cell_bits,
                     triangle.area);
      for (size_t i = 0; i < collected; ++i) {
        auto& [p, q, columns, cell, weight, spot] = batch[i];
        const color::ColumnTotals totals = color::totals_of(columns);
        weight = covered.weight(totals);
        spot = look->spot_at(covered.mean_point(p, q, totals));
        cell = cells_.cover(cell);
      }
      for (size_t i = 0; i < collected; ++i)
        look->add(batch[i].spot, batch[i].weight, cells_.sum(batch[i].cell));
      if (cells_.attributes().is_needed()) {
        if (!facing) facing.emplace(facing_of(surface));
        for (size_t i = 0; i < collected; ++i)
          cells_.attributes().add(batch[i].cell, *facing,
                                  static_cast<uint32_t>(popcount64(batch[i].columns)),
                                  batch[i].weight);
      }
      collected = 0;
    };
    const uint32_t* spread[3];
    for (int d = 0; d < 3; ++d) spread[d] = spread_[triangle.axis[d]];
    const int64_t low[3] = {first_[triangle.axis[0]], first_[triangle.axis[1]],
                            first_[triangle.axis[2]]};
    color::TouchedCells<Int>(triangle, range)
        .visit([&](int64_t p, int64_t q, int64_t r, uint32_t columns) {
          const uint32_t code =
              spread[0][p - low[0]] | spread[1][q - low[1]] | spread[2][r - low[2]];
          if (columns == 0) return wait(index, code);
          cells_.prefetch(code);
          auto& added = batch[collected++];
          added.p = p;
          added.q = q;
          added.columns = columns;
          added.cell = code;
          if (collected == kBatch) add_batch();
        });
    add_batch();
  }

  void wait(uint32_t index, uint32_t code) {
    if (cells_.is_covered(code)) return;
    cells_.touch(code);
    if (waiting_.size() == kMaxWaiting) add_waiting();
    waiting_.push_back({index, code});
  }
  // Adds closest points to those cells that nothing covers so far.
  void add_waiting() {
    std::optional<color::SurfaceLook<Textures>> look;
    color::SurfaceFacing facing;
    uint32_t last = 0;
    for (const Waiting& waiting : waiting_) {
      if (cells_.is_covered(waiting.code)) continue;
      const FixedSurface& surface = triangles_[waiting.triangle];
      if (!look || last != waiting.triangle) {
        look.emplace(surface, materials_[surface.material], textures_, grid_.cell_bits(),
                     color::area_of(surface.position));
        if (cells_.attributes().is_needed()) facing = facing_of(surface);
      }
      last = waiting.triangle;
      const uint32_t cell = cells_.touch(waiting.code);
      look->add(look->spot_at(color::closest_point(surface.position, center_of(waiting.code))), 1,
                cells_.sum(cell));
      if (cells_.attributes().is_needed()) cells_.attributes().add(cell, facing, 1, 1);
    }
    waiting_.clear();
  }

  color::SurfaceFacing facing_of(const FixedSurface& surface) const {
    return color::facing_of(surface, materials_[surface.material].number);
  }

  uint32_t code_of(const int64_t (&position)[3]) const {
    return spread_[0][position[0] - first_[0]] | spread_[1][position[1] - first_[1]] |
           spread_[2][position[2] - first_[2]];
  }
  // In lattice units.
  std::array<int64_t, 3> center_of(uint32_t code) const {
    uint32_t at[3];
    morton_decode(code, at[0], at[1], at[2]);
    std::array<int64_t, 3> center;
    for (size_t a = 0; a < 3; ++a)
      center[a] = (2 * (first_[a] + at[a]) + 1) << (grid_.cell_bits() - 1);
    return center;
  }

  const ColorGrid grid_;
  const std::span<const Material> materials_;
  Textures& textures_;
  uint32_t spread_[3][64];  // by axis: the bits of a coordinate in a code
  std::span<const FixedSurface> triangles_;
  uint32_t max_cells_ = 0;
  int64_t first_[3] = {}, last_[3] = {};  // cells of the region
  color::RegionCells cells_;
  std::vector<Waiting> waiting_;
  std::vector<CellValues> values_;  // none
};

// RegionBaker::bake() for a single region.
template <class Textures>
void bake_region(const ColorGrid& grid, const Cube& region, std::span<const FixedSurface> triangles,
                 std::span<const Material> materials, Textures& textures,
                 std::vector<ColoredCell>& cells) {
  RegionBaker<Textures>(grid, materials, textures).bake(region, triangles, cells);
}

}  // namespace voxdag
