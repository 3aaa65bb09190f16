// The cells that surfaces touch in a region, and the sums of these cells. Cells are found by their
// Morton codes in the region.
//
// A cell is covered if a surface covers one of its columns (cell_triangle.h). In a covered cell,
// surfaces that cover no column are ignored. Whether a cell is covered is known only at the end. So
// at first a cell's sum contains the surfaces that cover no column. The first surface that covers a
// column restarts the sum from zero. The final sums do not depend on the order of the surfaces.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "core/base/host_device.h"
#include "core/color/cell_values.h"
#include "core/color/color_sum.h"
#include "core/color/rule/attribute_sums.h"
#include "core/color/rule/color_grid.h"

namespace voxdag::color {

class RegionCells {
 public:
  static constexpr uint32_t kMaxCells = 1u << (3 * kRegionLevels);
  // Upper bound of the memory of all vectors while they grow, without AttributeSums.
  static constexpr uint64_t kMaxBytes =
      uint64_t{kMaxCells} * (4 + 3 * sizeof(ColorSum)) + (64 << 10);

  // `wanted`: the attributes to compute in addition to colors.
  explicit RegionCells(const AttributeSet& wanted = {})
      : attributes_(wanted), places_(kMaxCells), touched_(kMaxCells / 64) {}

  // Reserves address space for `cells` sums. The system provides pages only when sums are added.
  void reserve(size_t cells) { sums_.reserve(cells); }

  bool is_covered(uint32_t code) const { return places_[code] >= kCovered; }
  // Call prefetch() some time before touch() or cover(), so that these do not wait for memory.
  VOXDAG_PREFETCH void prefetch(uint32_t code) const { __builtin_prefetch(&places_[code]); }
  // Adds the cell if it is new, and returns the number of the cell, for sum() and attributes().
  uint32_t touch(uint32_t code) {
    uint32_t& place = places_[code];
    if (place == 0) {
      sums_.emplace_back();
      place = static_cast<uint32_t>(sums_.size());
      touched_[code / 64] |= uint64_t{1} << code % 64;
    }
    return (place & ~kCovered) - 1;
  }
  // Like touch(), for a surface that covers columns of the cell. The first call for a cell restarts
  // its sum from zero.
  uint32_t cover(uint32_t code) {
    const uint32_t number = touch(code);
    if (!is_covered(code)) {
      places_[code] |= kCovered;
      sums_[number] = {};
      if (attributes_.is_needed()) attributes_.reset(number);
    }
    return number;
  }
  ColorSum& sum(uint32_t number) { return sums_[number]; }
  size_t count() const { return sums_.size(); }

  AttributeSums& attributes() { return attributes_; }

  // Moves the cells into `cells`, in Morton order. Moves their normals and materials into `values`,
  // which remains empty if neither attribute is wanted.
  void take(std::vector<ColoredCell>& cells, std::vector<CellValues>& values) {
    cells.clear();
    cells.reserve(sums_.size());
    values.clear();
    if (attributes_.is_needed()) values.reserve(sums_.size());
    attributes_.finish();
    for (uint32_t word = 0; word < touched_.size(); ++word) {
      const uint64_t touched = std::exchange(touched_[word], 0);
      for (uint64_t rest = touched; rest != 0; rest &= rest - 1) {
        uint32_t& place = places_[word * 64 + static_cast<uint32_t>(lowest_bit(rest))];
        place = (place & ~kCovered) - 1;
        __builtin_prefetch(&sums_[place]);
      }
      for (uint64_t rest = touched; rest != 0; rest &= rest - 1) {
        const uint32_t code = word * 64 + static_cast<uint32_t>(lowest_bit(rest));
        const uint32_t number = std::exchange(places_[code], 0);
        cells.push_back({code, sums_[number]});
        if (attributes_.is_needed()) attributes_.get(number, values.emplace_back());
      }
    }
    sums_.clear();
    attributes_.clear();
  }

 private:
  static constexpr uint32_t kCovered = 1u << 31;

  AttributeSums attributes_;
  // For each Morton code: the cell's number in sums_, counted from 1, plus kCovered if the cell is
  // covered; 0 if no surface touches the cell.
  std::vector<uint32_t> places_;
  std::vector<uint64_t> touched_;
  std::vector<ColorSum> sums_;
};

}  // namespace voxdag::color
