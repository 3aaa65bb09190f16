// Numbers in binary files.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstring>

namespace voxdag {

// Returns the number at `bytes`, which need not be aligned.
template <class T>
T load_number(const std::byte* bytes, bool is_big_endian) {
  std::array<std::byte, sizeof(T)> own;
  std::memcpy(own.data(), bytes, sizeof(T));
  if (is_big_endian != (std::endian::native == std::endian::big)) std::ranges::reverse(own);
  return std::bit_cast<T>(own);
}
template <class T>
T load_little_endian(const std::byte* bytes) {
  return load_number<T>(bytes, false);
}

}  // namespace voxdag
