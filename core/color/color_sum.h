// The sum over the surfaces in a cell of the color grid, from which the cell's color is computed.
// Addition commutes, so the order of triangles, threads and subvolumes does not matter. The sum of
// a coarser cell is the sum of its children.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>

#include "core/base/host_device.h"

namespace voxdag {

// Sums of weights and of weighted intensities. The weight of a surface is proportional to its area
// in the cell (covered_surface.h). Intensities are linear with 16 bits; alpha has 8 bits.
struct ColorSum {
  std::array<uint64_t, 3> seen{};   // sums of weight x alpha x intensity: red, green, blue
  uint64_t seen_weight = 0;         // sum of weight x alpha
  std::array<uint64_t, 3> plain{};  // sums of weight x intensity; used if all alpha values are 0
  uint64_t weight = 0;              // sum of weights

  VOXDAG_HD void add(const ColorSum& other) {
    // Adds the members as eight numbers of one type, because compilers vectorize such a loop.
    uint64_t sums[8], more[8];
    static_assert(sizeof sums == sizeof(ColorSum));
    std::memcpy(sums, this, sizeof sums);
    std::memcpy(more, &other, sizeof more);
    for (int i = 0; i < 8; ++i) sums[i] += more[i];
    std::memcpy(static_cast<void*>(this), sums, sizeof sums);
  }
  bool operator==(const ColorSum&) const = default;
};

// The color of a surface that has the same color at all of its points: linear intensities with 16
// bits, and alpha with 8 bits.
struct FlatColor {
  std::array<uint16_t, 3> rgb{};
  uint8_t alpha = 255;
  bool operator==(const FlatColor&) const = default;

  // Adds a surface of this color to `sum`. A call with the sum of several weights has the same
  // result as a call for each weight, even if the members of `sum` overflow.
  VOXDAG_HD void add_to(ColorSum& sum, uint64_t weight) const {
    const uint64_t visible = weight * alpha;
    for (size_t c = 0; c < 3; ++c) {
      sum.seen[c] += visible * rgb[c];
      sum.plain[c] += weight * rgb[c];
    }
    sum.seen_weight += visible;
    sum.weight += weight;
  }
};

// A set cell of the color grid, in a region of 64^3 such cells.
struct ColoredCell {
  uint32_t code = 0;  // Morton code within the region, below 2^18
  ColorSum sum;       // its weight is above 0
};

// The stored color of a cell: sRGB with 8 bits, and linear alpha.
struct Color {
  std::array<uint8_t, 3> rgb{};
  uint8_t alpha = 255;
  bool operator==(const Color&) const = default;
};

}  // namespace voxdag
