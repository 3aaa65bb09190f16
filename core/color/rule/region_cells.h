// The cells that surfaces touch in a region, and the sums of these cells. Cells are found by their
// Morton codes in the region.
//
// A cell is covered if a surface covers one of its columns (cell_triangle.h). In a covered cell,
// surfaces that cover no column are ignored. Whether a cell is covered is known only at the end. So
// at first a cell's sum contains the surfaces that cover no column. The first surface that covers a
// column restarts the sum from zero. The final sums do not depend on the order of the surfaces.
//
// In most cells of scenes without textures, all surfaces have the same flat color. Such a cell
// needs only the sum of their weights, because its ColorSum is this number times the color. In most
// other cells, all surfaces are opaque. Such a cell needs no sums that involve alpha (CellWeight).
#pragma once

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <span>
#include <utility>
#include <vector>

#include "core/base/host_device.h"
#include "core/color/cell_values.h"
#include "core/color/color_of.h"
#include "core/color/color_sum.h"
#include "core/color/rule/add_weighted.h"
#include "core/color/rule/attribute_sums.h"
#include "core/color/rule/cell_weight.h"
#include "core/color/rule/color_grid.h"

namespace voxdag::color {

class RegionCells {
 public:
  static constexpr uint32_t kMaxCells = 1u << (3 * kRegionLevels);
  // Upper bound of the memory of all vectors, without AttributeSums. reserve() prevents that they
  // grow, which would need more.
  static constexpr uint64_t kMaxBytes =
      uint64_t{kMaxCells} * (sizeof(uint32_t) + sizeof(CellWeight) + sizeof(ColorSum)) + (64 << 10);

  // `wanted`: the attributes to compute in addition to colors.
  explicit RegionCells(const AttributeSet& wanted = {})
      : attributes_(wanted), places_(kMaxCells), touched_(kMaxCells / 64) {}

  // Reserves address space for `cells` cells. The system provides pages only when cells are added.
  void reserve(size_t cells) {
    weights_.reserve(cells);
    sums_.reserve(cells);
  }

  bool is_covered(uint32_t code) const { return places_[code] >= kCovered; }
  // Call prefetch() some time before touch() or cover(), so that these do not wait for memory.
  VOXDAG_PREFETCH void prefetch(uint32_t code) const { __builtin_prefetch(&places_[code]); }
  // Adds the cell if it is new, and returns the number of the cell, for add() and
  // attributes().
  uint32_t touch(uint32_t code) {
    uint32_t& place = places_[code];
    if (place == 0) {
      weights_.emplace_back();
      place = static_cast<uint32_t>(weights_.size());
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
      CellWeight& weight = weights_[number];
      if (weight.is_mixed())
        sums_[weight.number()] = {};
      else
        weight.clear();
      if (attributes_.is_needed()) attributes_.reset(number);
    }
    return number;
  }
  size_t count() const { return weights_.size(); }

  // Returns the index of a color for add(): CellWeight::kMixed if the region already has too many
  // flat colors.
  uint32_t index_of(const FlatColor& color) {
    for (size_t i = flats_.size(); i-- > 0;)
      if (flats_[i].color == color) return static_cast<uint32_t>(i) + CellWeight::kFirstFlat;
    if (flats_.size() == CellWeight::kMaxFlats) return CellWeight::kMixed;
    ColorSum sum;
    color.add_to(sum, 1);
    flats_.push_back({color, color_of(sum)});
    return static_cast<uint32_t>(flats_.size()) - 1 + CellWeight::kFirstFlat;
  }
  // Adds a surface of a flat color to a cell. `index` is index_of(color).
  void add(uint32_t number, const FlatColor& color, uint32_t index, uint64_t weight) {
    if (index == CellWeight::kMixed || !weights_[number].add_flat(index, weight))
      color.add_to(sum(number), weight);
  }
  // Adds a surface to a cell. `texel` has its intensities, `alpha` is from 0 to 255, and `weight`
  // is from 1 to 2^16 - 1.
  void add(uint32_t number, Texel texel, uint32_t alpha, uint64_t weight) {
    if (alpha == 255)
      add(number, CellWeight(texel, weight));
    else
      add_weighted(texel, weight, alpha * weight, sum(number));
  }
  // Adds the surfaces of an opaque cell.
  void add(uint32_t number, const CellWeight& opaque) {
    if (weights_[number].add_opaque(opaque)) return;
    OpaqueSum more;
    more.add(opaque);
    more.add_to(sum(number));
  }

  AttributeSums& attributes() { return attributes_; }

  // Moves the cells into `cells`, in Morton order. Moves their normals and materials into `values`,
  // which remains empty if neither attribute is wanted.
  void take(std::vector<ColoredCell>& cells, std::vector<CellValues>& values) {
    cells.clear();
    cells.reserve(count());
    values.clear();
    if (attributes_.is_needed()) values.reserve(count());
    attributes_.finish();
    take_siblings([&](uint32_t first, uint32_t mask, const uint32_t* numbers) {
      for (; mask != 0; mask &= mask - 1) {
        const uint32_t number = *numbers++;
        cells.push_back(
            {first + static_cast<uint32_t>(lowest_bit(mask)), sum_of(weights_[number])});
        if (attributes_.is_needed()) attributes_.get(number, values.emplace_back());
      }
      return numbers;
    });
  }
  // Moves the colors of the cells into `encoder`, a RegionEncoder, in Morton order.
  template <class Encoder>
  void take(uint32_t first_code, Encoder& encoder) {
    encoder.reserve(count());
    ColoredCell others[64];  // cells that combine() does not combine with their siblings
    size_t waiting = 0;
    const auto add_others = [&] { encoder.add({others, std::exchange(waiting, 0)}, first_code); };
    Siblings siblings;
    take_siblings([&](uint32_t first, uint32_t mask, const uint32_t* numbers) {
      const auto count = static_cast<size_t>(popcount64(mask));
      const uint32_t* const end = numbers + count;
      const bool is_simple = combine({numbers, count}, siblings);
      if (waiting > 0 && (is_simple || waiting > std::size(others) - 8)) add_others();
      if (is_simple) {
        encoder.add_siblings(first_code + first, std::span(siblings.colors).first(count),
                             siblings.sum);
        return end;
      }
      for (; numbers != end; mask &= mask - 1)
        others[waiting++] = {first + static_cast<uint32_t>(lowest_bit(mask)),
                             sum_of(weights_[*numbers++])};
      return end;
    });
    if (waiting > 0) add_others();
  }

 private:
  static constexpr uint32_t kCovered = 1u << 31;
  // Below this weight, no member of a ColorSum overflows. The color_of() a sum that has overflowed
  // differs from the stored color in `flats_`.
  static constexpr uint64_t kMaxFlatWeight = uint64_t{1} << 40;

  struct Flat {
    FlatColor color;
    Color stored;  // the color of a cell that only has surfaces of this color
  };

  // Returns the ColorSum of a cell, to which the caller can add any surface.
  ColorSum& sum(uint32_t number) {
    CellWeight& weight = weights_[number];
    if (!weight.is_mixed()) {
      if (weight.is_empty())
        sums_.emplace_back();
      else
        sums_.push_back(sum_of(weight));
      weight.set_mixed(sums_.size() - 1);
    }
    return sums_[weight.number()];
  }

  // The stored colors of cells with the same parent, and the sum of the cells.
  struct Siblings {
    Color colors[8];
    ColorSum sum;
  };

  // Computes the siblings with these numbers if they are all flat, of the same color, or all
  // opaque. Otherwise returns false.
  bool combine(std::span<const uint32_t> numbers, Siblings& siblings) const {
    const uint32_t index = weights_[numbers[0]].index();
    if (index == CellWeight::kMixed) return false;
    for (const uint32_t number : numbers)
      if (weights_[number].index() != index) return false;
    if (index == CellWeight::kOpaque) {
      OpaqueSum sum;
      for (size_t i = 0; i < numbers.size(); ++i) {
        const CellWeight& weight = weights_[numbers[i]];
        sum.add(weight);
        siblings.colors[i] = color_of_opaque(weight);
      }
      siblings.sum = sum.color_sum();
      return true;
    }
    uint64_t total = 0;
    for (const uint32_t number : numbers) total += weights_[number].number();
    if (total >= kMaxFlatWeight) return false;
    const auto& [color, stored] = flats_[index - CellWeight::kFirstFlat];
    std::fill_n(siblings.colors, numbers.size(), stored);
    siblings.sum = {};
    color.add_to(siblings.sum, total);
    return true;
  }
  static Color color_of_opaque(const CellWeight& cell) {
    return opaque_color_of(cell.opaque_weight(),
                           {cell.opaque_red(), cell.opaque_green(), cell.opaque_blue()});
  }
  ColorSum sum_of(const CellWeight& weight) const {
    if (weight.is_mixed()) return sums_[weight.number()];
    if (weight.is_opaque()) {
      OpaqueSum sum;
      sum.add(weight);
      return sum.color_sum();
    }
    ColorSum sum;
    if (!weight.is_empty())
      flats_[weight.index() - CellWeight::kFirstFlat].color.add_to(sum, weight.number());
    return sum;
  }

  // The cells whose codes have the same quotient by 64, and their numbers in the order of the
  // codes.
  struct Cells64 {
    uint64_t touched;  // bit i is set for the code 64 * quotient + i
    uint32_t count, numbers[64];
  };

  // Calls visit(first_code, mask, numbers) for each cell of the next coarser level that contains
  // cells, in Morton order, and then removes all cells. A cell has the code `first_code` + i for a
  // bit i of `mask`. `numbers` points to the numbers of the cells, in the order of the bits;
  // visit() returns the pointer behind them. The weights and sums of cells are prefetched while
  // earlier cells are visited.
  template <class Visit>
  void take_siblings(Visit&& visit) {
    const auto words = static_cast<uint32_t>(touched_.size());
    Cells64 cells[3];
    for (uint32_t word = 0; word < words + 2; ++word) {
      if (word < words) take_cells(word, cells[word % 3]);
      if (word >= 1 && word <= words) prefetch_sums(cells[(word - 1) % 3]);
      if (word < 2) continue;
      const Cells64& now = cells[(word - 2) % 3];
      const uint32_t* numbers = now.numbers;
      for (uint32_t i = 0; now.touched != 0 && i < 64; i += 8) {
        const auto mask = static_cast<uint32_t>(now.touched >> i & 255);
        if (mask == 0) continue;
        numbers = visit((word - 2) * 64 + i, mask, numbers);
      }
    }
    weights_.clear();
    sums_.clear();
    flats_.clear();
    attributes_.clear();
  }
  void take_cells(uint32_t word, Cells64& cells) {
    cells.touched = std::exchange(touched_[word], 0);
    cells.count = 0;
    for (uint64_t rest = cells.touched; rest != 0; rest &= rest - 1) {
      const uint32_t code = word * 64 + static_cast<uint32_t>(lowest_bit(rest));
      const uint32_t number = (std::exchange(places_[code], 0) & ~kCovered) - 1;
      __builtin_prefetch(&weights_[number]);
      cells.numbers[cells.count++] = number;
    }
  }
  VOXDAG_PREFETCH void prefetch_sums(const Cells64& cells) const {
    for (uint32_t i = 0; i < cells.count; ++i) {
      const CellWeight& weight = weights_[cells.numbers[i]];
      if (!weight.is_mixed()) continue;
      const ColorSum& sum = sums_[weight.number()];  // can be in two cache lines
      __builtin_prefetch(&sum.seen);
      __builtin_prefetch(&sum.weight);
    }
  }

  AttributeSums attributes_;
  // For each Morton code: the cell's number, which is an index into weights_ plus 1, plus kCovered
  // if the cell is covered; 0 if no surface touches the cell.
  std::vector<uint32_t> places_;
  std::vector<uint64_t> touched_;
  std::vector<CellWeight> weights_;
  std::vector<ColorSum> sums_;
  std::vector<Flat> flats_;
};

}  // namespace voxdag::color
