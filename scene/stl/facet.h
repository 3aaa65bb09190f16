// A facet of a binary STL file.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

namespace voxdag::stl {

template <class T>
T load_little_endian(const std::byte* bytes) {
  std::array<std::byte, sizeof(T)> own;
  std::memcpy(own.data(), bytes, sizeof(T));
  if constexpr (std::endian::native == std::endian::big)
    for (size_t i = 0; i < sizeof(T) / 2; ++i) std::swap(own[i], own[sizeof(T) - 1 - i]);
  return std::bit_cast<T>(own);
}

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
