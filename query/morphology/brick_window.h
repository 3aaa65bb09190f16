// The result of a window (steps.h) for one brick.
#pragma once

#include <array>
#include <cstdint>

#include "core/dag/brick.h"

namespace voxdag::query {

// 8 x 8 x 8 voxels: the brick and its neighbors. Bit 8y + z of slice x is the voxel (x, y, z).
class BrickWindow {
 public:
  // Adds a brick, whose first voxel comes to (x, y, z). The coordinates are 0 or 4.
  void add(uint64_t brick, int x, int y, int z) {
    for (int octant = 0; octant < 8; ++octant) {
      const uint64_t voxels = brick >> 8 * octant & 255;
      const int at = 8 * (y + (octant & 2)) + z + 2 * (octant & 1);
      const auto slice = static_cast<size_t>(x + (octant >> 1 & 2));
      slices_[slice] |= spread(voxels & 15) << at;
      slices_[slice + 1] |= spread(voxels >> 4) << at;
    }
  }
  // Replaces each voxel p by the union (or the intersection) of the voxels p - t for all t in
  // {0, ..., distance}^3, or of the voxels p + t if `is_upward` is true. The result is correct only
  // for the brick whose window is complete: the brick at 4, or at 0 if `is_upward` is true.
  void apply(bool is_erosion, bool is_upward, uint64_t distance) {
    const auto combine = [&](uint64_t& to, uint64_t from) {
      if (is_erosion)
        to &= from;
      else
        to |= from;
    };
    const auto moved = [&](uint64_t slice, uint64_t bits) {
      return is_upward ? slice >> bits : bits < 64 ? slice << bits : 0;
    };
    for (const uint64_t unit : {uint64_t{1}, uint64_t{8}})
      for (uint64_t& slice : slices_) {
        const uint64_t before = slice;
        for (uint64_t t = 1; t <= distance; ++t) combine(slice, moved(before, unit * t));
      }
    const auto before = slices_;
    for (size_t x = 0; x < 4; ++x) {
      const size_t to = is_upward ? x : x + 4;
      for (size_t t = 1; t <= distance; ++t)
        combine(slices_[to], before[is_upward ? to + t : to - t]);
    }
  }
  // Returns the brick whose first voxel is (at, at, at).
  uint64_t brick(int at) const {
    uint64_t brick = 0;
    for (int octant = 0; octant < 8; ++octant) {
      const int bit = 8 * (at + (octant & 2)) + at + 2 * (octant & 1);
      const auto slice = static_cast<size_t>(at + (octant >> 1 & 2));
      const uint64_t voxels = gathered(slices_[slice] >> bit) | gathered(slices_[slice + 1] >> bit)
                                                                    << 4;
      brick |= voxels << 8 * octant;
    }
    return brick;
  }

 private:
  // Move the four voxels of one x of an octant from a brick to a slice, and back.
  static constexpr uint64_t spread(uint64_t voxels) { return (voxels & 3) | (voxels & 12) << 6; }
  static constexpr uint64_t gathered(uint64_t slice) { return (slice & 3) | (slice >> 6 & 12); }

  std::array<uint64_t, 8> slices_ = {};
};

}  // namespace voxdag::query
