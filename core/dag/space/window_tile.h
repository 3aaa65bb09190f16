// A small cube of voxels, stored as rows of bits. spread() combines each voxel with the voxels in a
// window next to it, a row at a time.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/dag/brick.h"

namespace voxdag {

class WindowTile {
 public:
  static constexpr int kMaxEdge = 32;

  // Clears the tile and sets its edge, a power of two from 8 to kMaxEdge.
  void reset(int edge) {
    edge_ = edge;
    std::fill_n(rows_, edge * edge, 0u);
  }
  void invert() {
    for (int i = 0; i < edge_ * edge_; ++i) rows_[i] = ~rows_[i];
  }

  // Sets the voxels of a brick whose low corner is at (x, y, z).
  void put_brick(uint64_t mask, int x, int y, int z) {
    for (int i = 0; i < kBrickEdge; ++i)
      for (int j = 0; j < kBrickEdge; ++j) {
        const int bit = brick_bit(i, j, 0);
        const auto voxels = static_cast<uint32_t>((mask >> bit & 3) | (mask >> (bit + 8) & 3) << 2);
        row(x + i, y + j) |= voxels << z;
      }
  }
  // Returns the brick whose low corner is at (x, y, z).
  uint64_t brick(int x, int y, int z) const {
    uint64_t mask = 0;
    for (int i = 0; i < kBrickEdge; ++i)
      for (int j = 0; j < kBrickEdge; ++j) {
        const int bit = brick_bit(i, j, 0);
        const uint64_t voxels = rows_[(x + i) * edge_ + y + j] >> z & 0xf;
        mask |= (voxels & 3) << bit | (voxels >> 2) << (bit + 8);
      }
    return mask;
  }

  // Sets each voxel p for which p + [0, radius]^3 contains a set voxel. Voxels outside the tile
  // count as empty.
  void spread(int radius) {
    for (int width = 1; width <= radius;) {
      const int step = std::min(width, radius + 1 - width);
      for (int i = 0; i < edge_ * edge_; ++i) rows_[i] |= rows_[i] >> step;
      // The loop changes rows in ascending order, so row y + step has not changed when row y reads
      // it.
      for (int x = 0; x < edge_; ++x)
        for (int y = 0; y + step < edge_; ++y) row(x, y) |= row(x, y + step);
      for (int i = 0; i + step * edge_ < edge_ * edge_; ++i) rows_[i] |= rows_[i + step * edge_];
      width += step;
    }
  }

 private:
  uint32_t& row(int x, int y) { return rows_[x * edge_ + y]; }

  int edge_ = 0;
  uint32_t rows_[kMaxEdge * kMaxEdge] = {};  // by x and y; bit z of a row is voxel (x, y, z)
};

}  // namespace voxdag
