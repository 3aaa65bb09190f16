// Computes the colors and other attributes of the cells in a region of the color grid, by the rule
// of docs/color.md. The values of a cell are computed from a sum over the triangles that touch the
// cell (ColorSum in core/color/color_sum.h). This sum depends only on these triangles, their
// materials and the images. It does not depend on the order of the triangles, or on the region in
// which the cell is baked.
//
// `Textures` is a reader of images. An image is a pyramid of box-filtered levels. Its intensities
// are linear, with 16 bits per channel. The first level is the image itself. The members of
// `Textures` are
//     uint32_t levels(uint32_t image), width(uint32_t image, uint32_t level), height(...);
//     View view(uint32_t image, uint32_t level);
// A View refers to a level. Its members are
//     uint32_t width(), height();
//     uint64_t texel(uint32_t x, uint32_t y);  // 16 bits each: r lowest, then g, b, a
//     void prefetch(uint32_t x, uint32_t y);
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/color/color_sum.h"
#include "core/color/cutouts/visible_part.h"
#include "core/color/rule/cell_triangle.h"
#include "core/color/rule/closest_point.h"
#include "core/color/rule/color_grid.h"
#include "core/color/rule/covered_surface.h"
#include "core/color/rule/region_box.h"
#include "core/color/rule/region_cells.h"
#include "core/color/rule/surface_look.h"
#include "core/color/samples/sample_batch.h"
#include "core/color/surface.h"
#include "core/geometry/cube.h"

namespace voxdag {

// Bakes one region after another, on one thread, and reuses its memory for the next region.
template <class Textures>
class RegionBaker {
 public:
  // Upper bound of the memory that this object allocates. The bound excludes vectors that callers
  // pass. It also excludes the sums of normals and materials, which exist only if the constructor's
  // `wanted` contains these attributes.
  static constexpr uint64_t kMaxBytes = color::RegionCells::kMaxBytes + (uint64_t{1} << 20);
  // Maximum number of cells of a region that a triangle touches. Along the triangle's dominant
  // axis, the region has 64^2 columns of cells. The triangle's plane touches at most 4 cells of
  // each column.
  static constexpr uint32_t kTriangleCells = 4u << (2 * kRegionLevels);

  // The references must outlive this object. Each triangle's material is an index into `materials`.
  // With `cutouts`, a triangle contributes only to the cells in which it is visible.
  // `wanted`: the values that finish() computes in addition to colors. The value for materials is
  // Material::number.
  RegionBaker(const ColorGrid& grid, std::span<const Material> materials, Textures& textures,
              const AttributeSet& wanted = {}, const Cutouts* cutouts = nullptr)
      : grid_(grid),
        materials_(materials),
        textures_(textures),
        cutouts_(cutouts),
        region_(grid),
        cells_(wanted) {
    waiting_.reserve(kMaxWaiting);
  }

  // `region`: a cube of at most 64^3 color cells. `triangles`: at most 2^32 triangles, which
  // include all triangles that touch `region`. Sets `cells` to the cells that the triangles touch,
  // in Morton order.
  void bake(const Cube& region, std::span<const FixedSurface> triangles,
            std::vector<ColoredCell>& cells) {
    begin(region);
    add(triangles);
    finish(cells);
  }

  // Together, begin(), add() and finish() do the same as bake(), but triangles may come in any
  // number of parts. add() stops when the region has more than `max_cells` cells.
  void begin(const Cube& region, uint32_t max_cells = color::RegionCells::kMaxCells) {
    max_cells_ = max_cells;
    cells_.reserve(std::min(max_cells + kTriangleCells, color::RegionCells::kMaxCells));
    region_.move_to(region);
  }
  // Returns false if the region now has more than `max_cells` cells; it then has at most max_cells
  // + kTriangleCells cells. finish() must still be called in this case, but its result is
  // incomplete.
  bool add(std::span<const FixedSurface> triangles) {
    triangles_ = triangles;
    for (uint32_t i = 0; i < triangles.size() && cells_.count() <= max_cells_; ++i) add_triangle(i);
    add_waiting();
    return cells_.count() <= max_cells_;
  }
  // Like the other add(), but adds the triangles in parts. If normals or materials are wanted,
  // calls charge(bytes) after each part. `bytes` is the memory that the sums of normals and
  // materials have allocated so far. It grows by at most 16 MiB between two calls. If charge()
  // returns false, add() stops and returns false.
  template <class Charge>
  bool add(std::span<const FixedSurface> triangles, const Charge& charge) {
    constexpr size_t kTrianglesPerCharge = 16;
    if (!cells_.attributes().is_needed()) return add(triangles);
    bool has_all = true;
    for (size_t at = 0; has_all && at < triangles.size(); at += kTrianglesPerCharge) {
      has_all = add(triangles.subspan(at, std::min(kTrianglesPerCharge, triangles.size() - at))) &&
                charge(cells_.attributes().bytes());
    }
    return has_all;
  }
  // Each finish() ends the region that begin() started. Call exactly one of them. This one sets
  // `cells` as bake() does.
  void finish(std::vector<ColoredCell>& cells) { finish(cells, values_); }
  // Sets `cells` as bake() does. Sets `values` to an element for each cell if normals or materials
  // are wanted.
  void finish(std::vector<ColoredCell>& cells, std::vector<CellValues>& values) {
    cells_.take(cells, values);
  }
  // Adds the colors of the cells to `encoder`, a RegionEncoder. The code of a cell in the encoder's
  // region is `first_code` plus the cell's code in the region of begin().
  template <class Encoder>
  void finish(uint32_t first_code, Encoder& encoder) {
    cells_.take(first_code, encoder);
  }

 private:
  static constexpr size_t kMaxWaiting = 1 << 16;
  // A triangle that touches a cell and covers no column (cell_triangle.h) of the cell. It waits
  // because it contributes only if no triangle covers a column of the cell.
  struct Waiting {
    uint32_t triangle, code;
  };

  void add_triangle(uint32_t index) {
    const FixedTriangle& triangle = triangles_[index].position;
    const CellBox box = region_.cells_of(triangle);
    if (!region_.overlaps(box)) return;
    if (region_.is_tiny(triangle, box)) {
      const auto part = visible_part(triangles_[index]);
      if (!part || part->is_visible_in(cell_at(box.low))) wait(index, region_.code_of(box.low));
    } else if (color::is_narrow(triangle)) {
      add_in<int64_t>(index, box);
    } else {
      add_in<int128>(index, box);
    }
  }

  // Adds a triangle to the cells in which it covers columns. Cells are collected in a batch, so
  // that their memory is prefetched while other cells are found.
  template <class Int>
  class CoveredCells {
   public:
    CoveredCells(RegionBaker& baker, const FixedSurface& surface,
                 const color::CellTriangle<Int>& triangle)
        : baker_(baker), surface_(surface), triangle_(triangle), covered_(triangle) {}
    void add(int64_t p, int64_t q, uint32_t columns, uint32_t code) {
      baker_.cells_.prefetch(code);
      batch_[collected_].p = p;
      batch_[collected_].q = q;
      batch_[collected_].columns = columns;
      batch_[collected_].cell = code;
      if (++collected_ == kBatch) flush();
    }
    void flush() {
      if (collected_ == 0) return;
      if (!look_ && !flat_) prepare();
      const auto batch = std::span(batch_).first(collected_);
      if (flat_)
        add_flat(batch);
      else if (is_sampled_)
        add_samples(batch);
      else
        add_spots(batch);
      if (baker_.cells_.attributes().is_needed()) add_attributes();
      collected_ = 0;
    }

   private:
    static constexpr size_t kBatch = color::SampleBatch::kMaxCells;
    struct Cell {
      int64_t p, q;
      // `cell` is the cell's Morton code, and after cover() the cell's number in RegionCells.
      uint32_t columns, cell, weight;
    };

    void prepare() {
      const Material& material = baker_.materials_[surface_.material];
      const bool is_cut = baker_.has_mask(surface_.material);
      flat_ = color::flat_color_of(surface_, material, is_cut);
      if (flat_) {
        flat_index_ = baker_.cells_.index_of(*flat_);
        return;
      }
      look_.emplace(surface_, material, baker_.textures_, triangle_.cell_bits, triangle_.area,
                    is_cut);
      for (int d = 0; d < 2; ++d) first_[d] = baker_.region_.first(triangle_.axis[d]);
      is_sampled_ = baker_.kernels_ && look_->describe(sampled_) &&
                    covered_.describe(first_[0], first_[1], sampled_);
    }
    void add_flat(std::span<Cell> batch) {
      for (Cell& added : batch) {
        added.weight = covered_.weight(color::count_of(added.columns));
        added.cell = baker_.cells_.cover(added.cell);
        baker_.cells_.add(added.cell, *flat_, flat_index_, added.weight);
      }
    }
    void add_samples(std::span<Cell> batch) {
      color::SampleBatch& samples = baker_.samples_;
      for (size_t i = 0; i < batch.size(); ++i) {
        const Cell& added = batch[i];
        const color::ColumnTotals totals = color::totals_of(added.columns);
        samples.count[i] = static_cast<int32_t>(totals.count);
        samples.x[i] =
            static_cast<int32_t>(4 * (added.p - first_[0]) * totals.count + totals.sum_i);
        samples.y[i] =
            static_cast<int32_t>(4 * (added.q - first_[1]) * totals.count + totals.sum_j);
        samples.share[i] = color::reciprocal_of(totals.count);
      }
      baker_.kernels_->find_texels(sampled_, samples, batch.size());
      for (size_t i = 0; i < batch.size(); ++i) {
        batch[i].weight = covered_.weight(static_cast<uint32_t>(samples.count[i]));
        batch[i].cell = baker_.cells_.cover(batch[i].cell);
      }
      uint32_t others = baker_.kernels_->blend(sampled_, samples, batch.size());
      if (!look_->is_cut()) others = 0;
      for (size_t i = 0; i < batch.size(); ++i) {
        if (others >> i & 1)
          add_spot(batch[i], spot_of(batch[i]));
        else
          baker_.cells_.add(batch[i].cell, color::CellWeight::opaque(samples.weighted[i]));
      }
    }
    void add_spots(std::span<Cell> batch) {
      typename color::SurfaceLook<Textures>::Spot spots[kBatch];
      for (size_t i = 0; i < batch.size(); ++i) {
        spots[i] = spot_of(batch[i]);
        batch[i].weight = covered_.weight(color::count_of(batch[i].columns));
        batch[i].cell = baker_.cells_.cover(batch[i].cell);
      }
      for (size_t i = 0; i < batch.size(); ++i) add_spot(batch[i], spots[i]);
    }
    auto spot_of(const Cell& added) const {
      return look_->spot_at(covered_.mean_point(added.p, added.q, color::totals_of(added.columns)));
    }
    void add_spot(const Cell& added, const auto& spot) {
      const color::Texel texel = look_->texel_at(spot);
      baker_.cells_.add(added.cell, texel, look_->alpha(texel), added.weight);
    }
    void add_attributes() {
      if (!facing_) facing_.emplace(baker_.facing_of(surface_));
      for (const Cell& added : std::span(batch_).first(collected_))
        baker_.cells_.attributes().add(
            added.cell, *facing_, static_cast<uint32_t>(popcount64(added.columns)), added.weight);
    }

    RegionBaker& baker_;
    const FixedSurface& surface_;
    const color::CellTriangle<Int>& triangle_;
    const color::CoveredSurface<Int> covered_;
    std::optional<FlatColor> flat_;                     // the color, if it is flat
    uint32_t flat_index_ = 0;                           // index_of() this color in RegionCells
    std::optional<color::SurfaceLook<Textures>> look_;  // set if the color is not flat
    bool is_sampled_ = false;  // true if the kernels compute the color, from sampled_
    color::SampledSurface sampled_;
    int64_t first_[2] = {};  // least p and q of a cell
    std::optional<color::SurfaceFacing> facing_;
    Cell batch_[kBatch];
    size_t collected_ = 0;
  };

  template <class Int>
  void add_in(uint32_t index, const CellBox& box) {
    const FixedSurface& surface = triangles_[index];
    const color::CellTriangle<Int> triangle(surface.position, grid_.cell_bits());
    CoveredCells<Int> covered(*this, surface, triangle);
    const std::optional<VisiblePart> part = visible_part(surface);
    region_.visit(triangle, box, [&](const int64_t(&at)[3], uint32_t columns, uint32_t code) {
      if (part) {
        int64_t cell[3];
        for (int d = 0; d < 3; ++d) cell[triangle.axis[d]] = at[d];
        if (!part->is_visible_in(cell_at(cell))) return;
      }
      if (columns == 0)
        wait(index, code);
      else
        covered.add(at[0], at[1], columns, code);
    });
    covered.flush();
  }

  void wait(uint32_t index, uint32_t code) {
    if (cells_.is_covered(code)) return;
    cells_.touch(code);
    if (waiting_.size() == kMaxWaiting) add_waiting();
    waiting_.push_back({index, code});
  }
  // Adds the triangles in waiting_ to the cells in which no triangle covers a column so far. The
  // color of such a triangle is its color at the point closest to the cell's center.
  void add_waiting() {
    std::optional<color::SurfaceLook<Textures>> look;
    color::SurfaceFacing facing;
    uint32_t last = 0;
    for (const Waiting& waiting : waiting_) {
      if (cells_.is_covered(waiting.code)) continue;
      const FixedSurface& surface = triangles_[waiting.triangle];
      if (!look || last != waiting.triangle) {
        look.emplace(surface, materials_[surface.material], textures_, grid_.cell_bits(),
                     color::area_of(surface.position), has_mask(surface.material));
        if (cells_.attributes().is_needed()) facing = facing_of(surface);
      }
      last = waiting.triangle;
      const uint32_t cell = cells_.touch(waiting.code);
      const color::Texel texel = look->texel_at(
          look->spot_at(color::closest_point(surface.position, region_.center_of(waiting.code))));
      cells_.add(cell, texel, look->alpha(texel), 1);
      if (cells_.attributes().is_needed()) cells_.attributes().add(cell, facing, 1, 1);
    }
    waiting_.clear();
  }

  color::SurfaceFacing facing_of(const FixedSurface& surface) const {
    return color::facing_of(surface, materials_[surface.material].number);
  }

  bool has_mask(uint32_t material) const { return cutouts_ && cutouts_->mask(material); }
  // Returns the visible part of a surface; nullopt if the complete surface is visible, because its
  // material is opaque or there are no cutouts.
  std::optional<VisiblePart> visible_part(const FixedSurface& surface) const {
    if (!cutouts_ || !cutouts_->may_cut(surface.material)) return std::nullopt;
    return VisiblePart(surface, *cutouts_, grid_.levels);
  }
  Cube cell_at(const int64_t (&position)[3]) const {
    return {grid_.color_levels,
            {static_cast<uint32_t>(position[0]), static_cast<uint32_t>(position[1]),
             static_cast<uint32_t>(position[2])}};
  }

  const ColorGrid grid_;
  const std::span<const Material> materials_;
  Textures& textures_;
  const Cutouts* const cutouts_;
  std::span<const FixedSurface> triangles_;
  uint32_t max_cells_ = 0;
  color::RegionBox region_;
  color::RegionCells cells_;
  const color::SampleKernels* const kernels_ = color::sample_kernels_avx2();
  color::SampleBatch samples_ = {};
  std::vector<Waiting> waiting_;
  std::vector<CellValues> values_;  // values that finish(cells) discards
};

// RegionBaker::bake() for a single region.
template <class Textures>
void bake_region(const ColorGrid& grid, const Cube& region, std::span<const FixedSurface> triangles,
                 std::span<const Material> materials, Textures& textures,
                 std::vector<ColoredCell>& cells) {
  RegionBaker<Textures>(grid, materials, textures).bake(region, triangles, cells);
}

}  // namespace voxdag
