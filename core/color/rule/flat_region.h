// The cells of a region in which all surfaces have the same flat color. All cells of such a region
// have this color. So a bit per cell, and the sum of all weights in the region, replace the sums of
// the single cells (RegionCells).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/color/color_sum.h"
#include "core/color/cutouts/cutouts.h"
#include "core/color/rule/cell_triangle.h"
#include "core/color/rule/color_grid.h"
#include "core/color/rule/columns.h"
#include "core/color/rule/covered_surface.h"
#include "core/color/rule/region_box.h"
#include "core/color/rule/surface_look.h"
#include "core/color/surface.h"

namespace voxdag {

// Returns the color of all surfaces, if they have the same flat color and `cutouts` (which can be
// null) cut out none of them. A surface's material is an index into `materials`.
inline std::optional<FlatColor> only_color_of(std::span<const FixedSurface> surfaces,
                                              std::span<const Material> materials,
                                              const Cutouts* cutouts) {
  std::optional<FlatColor> only;
  for (const FixedSurface& surface : surfaces) {
    const auto color = color::flat_color_of(surface, materials[surface.material]);
    if (!color || (only && color != only) || (cutouts && cutouts->may_cut(surface.material)))
      return std::nullopt;
    only = color;
  }
  return only;
}

// Finds the cells of one region after another, and reuses its memory for the next region.
class FlatRegion {
 public:
  // Upper bound of the memory that this object allocates.
  static constexpr uint64_t kMaxBytes = uint64_t{512} << 10;
  // Maximum length of waiting_. find() lets it grow to half of this length, and a surface adds at
  // most RegionBaker::kTriangleCells elements, a quarter of it.
  static constexpr size_t kMaxWaiting = size_t{1} << 16;

  explicit FlatRegion(const ColorGrid& grid)
      : grid_(grid), region_(grid), covered_(kWords), touched_(kWords) {
    waiting_.reserve(kMaxWaiting);
  }

  // Sets cells() and weight() for a region, a cube of at most 64^3 color cells. `surfaces` must
  // include all surfaces that touch the region. Returns false if the region has too many surfaces:
  // a color sum could overflow, or too many surfaces touch cells in which no surface covers a
  // column.
  bool find(const Cube& region, std::span<const FixedSurface> surfaces) {
    region_.move_to(region);
    std::ranges::fill(covered_, 0);
    std::ranges::fill(touched_, 0);
    waiting_.clear();
    weight_ = 0;
    for (const FixedSurface& surface : surfaces) {
      add(surface.position);
      if (waiting_.size() > kMaxWaiting / 2) remove_covered();
      if (waiting_.size() > kMaxWaiting / 2 || weight_ >= kWeightLimit) return false;
    }
    remove_covered();
    weight_ += waiting_.size();
    for (size_t i = 0; i < kWords; ++i) touched_[i] |= covered_[i];
    return weight_ < kWeightLimit;
  }

  // The cells that surfaces touch: bit i % 64 of element i / 64 for the cell with Morton code i.
  std::span<const uint64_t> cells() const { return touched_; }
  // The sum of the weights of all surfaces in all cells.
  uint64_t weight() const { return weight_; }

 private:
  static constexpr size_t kWords = (size_t{1} << 3 * kRegionLevels) / 64;
  // Below this weight, no member of a ColorSum overflows. A sum that has overflowed gives a
  // different color.
  static constexpr uint64_t kWeightLimit = uint64_t{1} << 40;

  void add(const FixedTriangle& triangle) {
    const CellBox box = region_.cells_of(triangle);
    if (!region_.overlaps(box)) return;
    if (region_.is_tiny(triangle, box))
      wait(region_.code_of(box.low));
    else if (color::is_narrow(triangle))
      add_in<int64_t>(triangle, box);
    else
      add_in<int128>(triangle, box);
  }
  template <class Int>
  void add_in(const FixedTriangle& triangle, const CellBox& box) {
    const color::CellTriangle<Int> prepared(triangle, grid_.cell_bits());
    uint32_t all_columns = 0;
    region_.visit(prepared, box, [&](const int64_t(&)[3], uint32_t columns, uint32_t code) {
      if (columns == 0) return wait(code);
      covered_[code / 64] |= uint64_t{1} << code % 64;
      all_columns += color::count_of(columns);
    });
    weight_ += color::CoveredSurface<Int>(prepared).weight(all_columns);
  }

  bool is_covered(uint32_t code) const { return covered_[code / 64] >> code % 64 & 1; }
  // Remembers a surface that covers no column of a cell. The surface has weight 1 if no surface
  // covers a column of the cell.
  void wait(uint32_t code) {
    if (is_covered(code)) return;
    touched_[code / 64] |= uint64_t{1} << code % 64;
    waiting_.push_back(code);
  }
  void remove_covered() {
    std::erase_if(waiting_, [&](uint32_t code) { return is_covered(code); });
  }

  const ColorGrid grid_;
  color::RegionBox region_;
  std::vector<uint64_t> covered_, touched_;  // a bit for each Morton code
  // Cells in which a surface covers no column, once for each such surface. Some of them can be
  // covered by other surfaces.
  std::vector<uint32_t> waiting_;
  uint64_t weight_ = 0;
};

}  // namespace voxdag
