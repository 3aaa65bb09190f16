// What RegionCells stores of a cell's surfaces in 16 bytes. Most cells need no more. The other
// cells have a ColorSum elsewhere.
//
//     kind     low                                  high
//     empty    0                                    0
//     flat     index (5 bits), weight               0
//     opaque   kOpaque (5), weight (27), red (32)   green (32), blue (32)
//     mixed    kMixed (5), number of the ColorSum   0
//
// Fields begin at the lowest bit. An empty cell has no surface so far. All surfaces of a flat cell
// have the flat color number `index` of the region; `weight` is the sum of their weights, below
// 2^56. All surfaces of an opaque cell have alpha 255. Its weight is below kMaxOpaqueWeight, so its
// sums of weight x intensity are below 2^32.
#pragma once

#include <cstdint>

#include "core/color/color_sum.h"
#include "core/color/rule/texture_lookup.h"

namespace voxdag::color {

class CellWeight {
 public:
  static constexpr int kIndexBits = 5;
  static constexpr uint32_t kMixed = (1 << kIndexBits) - 1, kOpaque = kMixed - 1;
  // Flat colors have the indices below kMaxFlats.
  static constexpr uint32_t kMaxFlats = kOpaque;
  static constexpr uint64_t kMaxOpaqueWeight = uint64_t{1} << 16;

  bool is_empty() const { return low_ == 0; }
  uint32_t index() const { return static_cast<uint32_t>(low_ & kMixed); }
  bool is_opaque() const { return index() == kOpaque; }
  bool is_mixed() const { return index() == kMixed; }
  // The weight of a flat cell, or the number of the ColorSum of a mixed cell.
  uint64_t number() const { return low_ >> kIndexBits; }

  void clear() { *this = {}; }
  void set_mixed(uint64_t number) {
    low_ = number << kIndexBits | kMixed;
    high_ = 0;
  }
  // Adds a surface of a flat color. Returns false, without effect, if the cell is neither empty nor
  // flat with this index.
  bool add_flat(uint32_t index, uint64_t weight) {
    if (!is_empty() && this->index() != index) return false;
    low_ = (low_ & ~uint64_t{kMixed}) + (weight << kIndexBits) + index;
    return true;
  }
  // Adds a surface of alpha 255 with the color of `texel`. `weight` is below kMaxOpaqueWeight.
  // Returns false, without effect, if the cell is neither empty nor opaque, or if its weight would
  // become too large.
  bool add_opaque(Texel texel, uint64_t weight) {
    if (!is_empty() && !is_opaque()) return false;
    const uint64_t total = opaque_weight() + weight;
    if (total >= kMaxOpaqueWeight) return false;
    // No field overflows into the next one.
    low_ = (low_ & ~uint64_t{kMixed}) + (weight << kIndexBits) + kOpaque +
           (weight * channel(texel, 0) << 32);
    high_ += weight * channel(texel, 1) + (weight * channel(texel, 2) << 32);
    return true;
  }

  // Members of an opaque cell: its weight, and its sums of weight x intensity.
  uint64_t opaque_weight() const { return (low_ & UINT32_MAX) >> kIndexBits; }
  uint64_t opaque_red() const { return low_ >> 32; }
  uint64_t opaque_green() const { return high_ & UINT32_MAX; }
  uint64_t opaque_blue() const { return high_ >> 32; }

 private:
  uint64_t low_ = 0, high_ = 0;
};

// The sums of opaque cells together.
class OpaqueSum {
 public:
  void add(const CellWeight& cell) {
    weight_ += cell.opaque_weight();
    sums_[0] += cell.opaque_red();
    sums_[1] += cell.opaque_green();
    sums_[2] += cell.opaque_blue();
  }
  ColorSum color_sum() const {
    ColorSum sum;
    for (size_t c = 0; c < 3; ++c) {
      sum.plain[c] = sums_[c];
      sum.seen[c] = 255 * sums_[c];
    }
    sum.weight = weight_;
    sum.seen_weight = 255 * weight_;
    return sum;
  }

 private:
  uint64_t weight_ = 0, sums_[3] = {};
};

}  // namespace voxdag::color
