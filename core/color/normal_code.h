// Normals in two bytes, by the octahedral projection. Codes are computed with integers and with
// IEEE doubles in a fixed order (docs/color.md, "Other attributes"), so that the same sums produce
// the same bytes on every machine.
//
//     byte 0: 127 + 127 px, byte 1: 127 + 127 py, each 0 to 254
//
// For a direction (x, y, z) with z >= 0, (px, py) = (x, y) / (|x| + |y| + |z|). For z < 0, this
// point is mirrored at the diagonals: ((1 - |py|) sign x, (1 - |px|) sign y). The sign of 0 is
// positive.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "core/base/host_device.h"

namespace voxdag {

// The two bytes of a normal: byte 0 in the low 8 bits, byte 1 in the high 8 bits.
using NormalCode = uint16_t;

// The normal (0, 0, 1), for cells whose sums give no direction.
inline constexpr NormalCode kNoNormal = 127 << 8 | 127;

namespace color {

VOXDAG_HD inline int64_t absolute(int64_t x) { return x < 0 ? -x : x; }

// Returns 127 x / length rounded to nearest, halves away from zero. Requires 0 <= |x| <= length <
// 2^55.
VOXDAG_HD inline int64_t in_127ths(int64_t x, int64_t length) {
  const int64_t magnitude = (254 * absolute(x) + length) / (2 * length);
  return x < 0 ? -magnitude : magnitude;
}

}  // namespace color

// Returns the code of a direction of any length. Requires components of a magnitude below 2^53, not
// all 0.
VOXDAG_HD inline NormalCode encode_normal(int64_t x, int64_t y, int64_t z) {
  const int64_t width = color::absolute(x), height = color::absolute(y);
  const int64_t length = width + height + color::absolute(z);
  int64_t across = x, along = y;
  if (z < 0) {
    across = x < 0 ? height - length : length - height;
    along = y < 0 ? width - length : length - width;
  }
  return static_cast<NormalCode>((127 + color::in_127ths(across, length)) |
                                 (127 + color::in_127ths(along, length)) << 8);
}

// Returns the direction of a code as a vector of length 2^14, each component rounded to nearest.
// Requires bytes of at most 254.
VOXDAG_HD inline std::array<int64_t, 3> decode_normal(NormalCode code) {
  const int across = (code & 255) - 127, along = (code >> 8) - 127;
  const int width = across < 0 ? -across : across, height = along < 0 ? -along : along;
  int x = across, y = along;
  const int z = 127 - width - height;
  if (z < 0) {
    x = across < 0 ? height - 127 : 127 - height;
    y = along < 0 ? width - 127 : 127 - width;
  }
  const double scale = 16384.0 / std::sqrt(static_cast<double>(x * x + y * y + z * z));
  const auto rounded = [scale](int component) {
    const double scaled = static_cast<double>(component) * scale;
    return static_cast<int64_t>(component < 0 ? scaled - 0.5 : scaled + 0.5);
  };
  return {rounded(x), rounded(y), rounded(z)};
}

}  // namespace voxdag
