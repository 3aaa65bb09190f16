// A facet of a binary STL file.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "scene/load_number.h"

namespace voxdag::stl {

struct Facet {
  std::array<double, 3> normal;
  std::array<double, 9> corners;
  uint16_t attribute;
};

// Reads a facet from its 50 bytes.
inline Facet load_facet(std::span<const std::byte> bytes) {
  Facet facet;
  const auto number = [&](size_t i) {
    return static_cast<double>(load_little_endian<float>(bytes.data() + 4 * i));
  };
  for (size_t i = 0; i < 3; ++i) facet.normal[i] = number(i);
  for (size_t i = 0; i < 9; ++i) facet.corners[i] = number(3 + i);
  facet.attribute = load_little_endian<uint16_t>(bytes.data() + 48);
  return facet;
}

}  // namespace voxdag::stl
