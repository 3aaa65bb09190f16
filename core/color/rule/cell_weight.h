// The 16 bytes that RegionCells stores for each cell. For most cells, they contain the sums over
// the cell's surfaces. The other cells also have a ColorSum.
//
//     kind     low                       high
//     empty    0                         0
//     flat     weight                    0 (32), index (5)
//     opaque   red (32), green (32)      blue (32), kOpaque (5), weight (27)
//     mixed    number of the ColorSum    0 (32), kMixed (5)
//
// Fields begin at the lowest bit. An empty cell has no surface so far. All surfaces of a flat cell
// have the flat color number `index` of the region; `weight` is the sum of their weights. All
// surfaces of an opaque cell have alpha 255. Its weight is below kMaxOpaqueWeight, so its sums of
// weight x intensity are below 2^32.
#pragma once

#include <cstdint>

#include "core/color/color_sum.h"
#include "core/color/rule/texture_lookup.h"

namespace voxdag::color {

class CellWeight {
 public:
  static constexpr int kIndexBits = 5;
  static constexpr uint32_t kMixed = (1 << kIndexBits) - 1, kOpaque = kMixed - 1;
  // Flat colors have the indices below kMaxFlats. Index 0 is not used, so that only the field of an
  // empty cell is 0.
  static constexpr uint32_t kFirstFlat = 1, kMaxFlats = kOpaque - kFirstFlat;
  static constexpr uint64_t kMaxOpaqueWeight = uint64_t{1} << 16;

  CellWeight() = default;
  // A cell with one surface of alpha 255, which has the color of `texel`. `weight` is from 1 to
  // kMaxOpaqueWeight - 1.
  CellWeight(Texel texel, uint64_t weight)
      : low_(weight * channel(texel, 0) | weight * channel(texel, 1) << 32),
        high_(weight * channel(texel, 2) | weight << (32 + kIndexBits) | kOpaqueBits) {}
  // An opaque cell in the format of SampleBatch::weighted.
  static CellWeight opaque(const uint32_t (&fields)[4]) {
    CellWeight cell;
    cell.low_ = fields[0] | uint64_t{fields[1]} << 32;
    cell.high_ = fields[2] | uint64_t{fields[3]} << 32;
    return cell;
  }

  bool is_empty() const { return kind() == 0; }
  uint32_t index() const { return kind() & kMixed; }
  bool is_opaque() const { return index() == kOpaque; }
  bool is_mixed() const { return index() == kMixed; }
  // The weight of a flat cell, or the number of the ColorSum of a mixed cell.
  uint64_t number() const { return low_; }

  void clear() { *this = {}; }
  void set_mixed(uint64_t number) {
    low_ = number;
    high_ = uint64_t{kMixed} << 32;
  }
  // Adds a surface of a flat color. Returns false, without effect, if the cell is neither empty nor
  // flat with this index.
  bool add_flat(uint32_t index, uint64_t weight) {
    if (!is_empty() && kind() != index) return false;
    low_ += weight;
    high_ = uint64_t{index} << 32;
    return true;
  }
  // Adds the surfaces of an opaque cell. Returns false, without effect, if this cell is neither
  // empty nor opaque, or if its weight would become too large.
  bool add_opaque(const CellWeight& more) {
    if (is_empty()) {
      *this = more;
      return true;
    }
    if (!is_opaque() || opaque_weight() + more.opaque_weight() >= kMaxOpaqueWeight) return false;
    low_ += more.low_;  // no field overflows into the next one
    high_ += more.high_ - kOpaqueBits;
    return true;
  }

  // Members of an opaque cell: its weight, and its sums of weight x intensity.
  uint64_t opaque_weight() const { return high_ >> (32 + kIndexBits); }
  uint64_t opaque_red() const { return low_ & UINT32_MAX; }
  uint64_t opaque_green() const { return low_ >> 32; }
  uint64_t opaque_blue() const { return high_ & UINT32_MAX; }

 private:
  static constexpr uint64_t kOpaqueBits = uint64_t{kOpaque} << 32;

  uint32_t kind() const { return static_cast<uint32_t>(high_ >> 32); }

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
  void add_to(ColorSum& sum) const {
    for (size_t c = 0; c < 3; ++c) {
      sum.plain[c] += sums_[c];
      sum.seen[c] += 255 * sums_[c];
    }
    sum.weight += weight_;
    sum.seen_weight += 255 * weight_;
  }
  ColorSum color_sum() const {
    ColorSum sum;
    add_to(sum);
    return sum;
  }

 private:
  uint64_t weight_ = 0, sums_[3] = {};
};

}  // namespace voxdag::color
