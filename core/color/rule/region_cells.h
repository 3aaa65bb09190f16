// The cells that surfaces touch in a region, and the sums of these cells. Cells are found by their
// Morton codes in the region.
//
// A cell is covered if a surface covers one of its columns (cell_triangle.h). In a covered cell,
// surfaces that cover no column are ignored. Whether a cell is covered is known only at the end. So
// at first a cell's sum contains the surfaces that cover no column. The first surface that covers a
// column restarts the sum from zero. The final sums do not depend on the order of the surfaces.
//
// In most cells of scenes without textures, all surfaces have the same flat color. Such a cell
// needs only the sum of their weights, because its ColorSum is this number times the color.
#pragma once

#include <cstdint>
#include <iterator>
#include <utility>
#include <vector>

#include "core/base/host_device.h"
#include "core/color/cell_values.h"
#include "core/color/color_of.h"
#include "core/color/color_sum.h"
#include "core/color/rule/attribute_sums.h"
#include "core/color/rule/color_grid.h"

namespace voxdag::color {

class RegionCells {
 public:
  static constexpr uint32_t kMaxCells = 1u << (3 * kRegionLevels);
  // Upper bound of the memory of all vectors, without AttributeSums. reserve() prevents that they
  // grow, which would need more.
  static constexpr uint64_t kMaxBytes =
      uint64_t{kMaxCells} * (sizeof(uint32_t) + sizeof(uint64_t) + sizeof(ColorSum)) + (64 << 10);

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
  // Adds the cell if it is new, and returns the number of the cell, for add(), sum() and
  // attributes().
  uint32_t touch(uint32_t code) {
    uint32_t& place = places_[code];
    if (place == 0) {
      weights_.push_back(0);
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
      uint64_t& weight = weights_[number];
      if (is_mixed(weight))
        sums_[weight >> kIndexBits] = {};
      else
        weight = 0;
      if (attributes_.is_needed()) attributes_.reset(number);
    }
    return number;
  }
  size_t count() const { return weights_.size(); }

  // Returns the index of a color for add(): kMixed if the region already has too many flat colors.
  uint32_t index_of(const FlatColor& color) {
    for (size_t i = flats_.size(); i-- > 0;)
      if (flats_[i].color == color) return static_cast<uint32_t>(i);
    if (flats_.size() == kMaxFlats) return kMixed;
    ColorSum sum;
    color.add_to(sum, 1);
    flats_.push_back({color, color_of(sum)});
    return static_cast<uint32_t>(flats_.size()) - 1;
  }
  // Adds a surface of a flat color to a cell. `index` is index_of(color).
  void add(uint32_t number, const FlatColor& color, uint32_t index, uint64_t weight) {
    uint64_t& total = weights_[number];
    if (index != kMixed && (total == 0 || (total & kIndexMask) == index))
      total = (total & ~kIndexMask) + (weight << kIndexBits) + index;
    else
      color.add_to(sum(number), weight);
  }
  // Returns the ColorSum of a cell, to which the caller can add any surface.
  ColorSum& sum(uint32_t number) {
    uint64_t& weight = weights_[number];
    if (!is_mixed(weight)) {
      if (weight == 0)
        sums_.emplace_back();
      else
        sums_.push_back(sum_of(weight));
      weight = (sums_.size() - 1) << kIndexBits | kMixed;
    }
    return sums_[weight >> kIndexBits];
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
    ColoredCell others[64];  // cells that are not flat
    size_t waiting = 0;
    const auto add_others = [&] { encoder.add({others, std::exchange(waiting, 0)}, first_code); };
    take_siblings([&](uint32_t first, uint32_t mask, const uint32_t* numbers) {
      const uint64_t index = weights_[numbers[0]] & kIndexMask;
      bool is_flat = index != kMixed;
      uint64_t total = 0;
      const uint32_t* end = numbers;
      for (uint32_t rest = mask; rest != 0; rest &= rest - 1) {
        const uint64_t weight = weights_[*end++];
        is_flat &= (weight & kIndexMask) == index;
        total += weight >> kIndexBits;
      }
      is_flat &= total < kMaxFlatWeight;
      if (waiting > 0 && (is_flat || waiting > std::size(others) - 8)) add_others();
      if (is_flat) {
        const auto& [color, stored] = flats_[index];
        encoder.add_siblings(first_code + first, static_cast<size_t>(end - numbers), color, total,
                             stored);
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
  // An element of weights_ consists of an index, in the lowest bits, and a number. If the index is
  // kMixed, the number is an index into sums_. Otherwise the index is an index into flats_, and the
  // number is the sum of the weights, below 2^56. The element 0 stands for no surface.
  static constexpr int kIndexBits = 5;
  static constexpr uint64_t kIndexMask = (1 << kIndexBits) - 1;
  static constexpr uint32_t kMixed = kIndexMask;
  static constexpr size_t kMaxFlats = kMixed;
  // Below this weight, no member of a ColorSum overflows. The color_of() a sum that has overflowed
  // differs from the stored color in `flats_`.
  static constexpr uint64_t kMaxFlatWeight = uint64_t{1} << 40;

  struct Flat {
    FlatColor color;
    Color stored;  // the color of a cell that only has surfaces of this color
  };

  static bool is_mixed(uint64_t weight) { return (weight & kIndexMask) == kMixed; }
  ColorSum sum_of(uint64_t weight) const {
    if (is_mixed(weight)) return sums_[weight >> kIndexBits];
    ColorSum sum;
    if (weight != 0) flats_[weight & kIndexMask].color.add_to(sum, weight >> kIndexBits);
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
      const uint64_t weight = weights_[cells.numbers[i]];
      if (!is_mixed(weight)) continue;
      const ColorSum& sum = sums_[weight >> kIndexBits];  // can be in two cache lines
      __builtin_prefetch(&sum.seen);
      __builtin_prefetch(&sum.weight);
    }
  }

  AttributeSums attributes_;
  // For each Morton code: the cell's number, which is an index into weights_ plus 1, plus kCovered
  // if the cell is covered; 0 if no surface touches the cell.
  std::vector<uint32_t> places_;
  std::vector<uint64_t> touched_;
  std::vector<uint64_t> weights_;
  std::vector<ColorSum> sums_;
  std::vector<Flat> flats_;
};

}  // namespace voxdag::color
