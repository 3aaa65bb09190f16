// A bilinear lookup in one level of an image's pyramid, in integers. Texture coordinates are
// wrapped in fixed point, then scaled to the size of the level. The fraction of a texel has 8 bits.
#pragma once

#include <cstdint>

#include "core/base/host_device.h"
#include "core/color/intensity.h"
#include "core/color/surface.h"

namespace voxdag::color {

// Four channels of 16 bits, red lowest, alpha highest.
using Texel = uint64_t;

VOXDAG_HD inline uint32_t channel(Texel texel, int index) {
  return static_cast<uint32_t>(texel >> (16 * index)) & 0xffff;
}

// Wraps a coordinate into [0, 2^kTextureBits].
VOXDAG_HD inline int64_t wrapped(int64_t coordinate, Wrap wrap) {
  constexpr int64_t kOne = int64_t{1} << kTextureBits;
  if (wrap == Wrap::kRepeat) return coordinate & (kOne - 1);
  if (wrap == Wrap::kClampToEdge) return coordinate < 0 ? 0 : coordinate > kOne ? kOne : coordinate;
  const int64_t in_two = coordinate & (2 * kOne - 1);
  return in_two > kOne ? 2 * kOne - in_two : in_two;
}

// The two texels next to a coordinate along one axis, and the weight of the second texel in units
// of 1/256.
struct TexelPair {
  uint32_t first, second, fraction;
};

VOXDAG_HD inline TexelPair texels_at(int64_t coordinate, Wrap wrap, uint32_t size) {
  const int64_t position = wrapped(coordinate, wrap) * size - (int64_t{1} << (kTextureBits - 1));
  const int64_t first = position >> kTextureBits;
  TexelPair pair;
  pair.fraction = static_cast<uint32_t>(position >> (kTextureBits - 8)) & 255;
  const uint32_t beyond_first = wrap == Wrap::kRepeat ? size - 1 : 0;
  const uint32_t beyond_last = wrap == Wrap::kRepeat ? 0 : size - 1;
  pair.first = first < 0 ? beyond_first : static_cast<uint32_t>(first);
  pair.second =
      first + 1 < static_cast<int64_t>(size) ? static_cast<uint32_t>(first + 1) : beyond_last;
  return pair;
}

// Returns the mean of four texels, weighted by the fractions. `even` and `odd` have two channels
// each, in lanes of 32 bits. The sums in a lane do not overflow, because 65535 * 65536 + 32768 <
// 2^32.
VOXDAG_HD inline Texel blended(const Texel (&texels)[4], uint32_t x_fraction, uint32_t y_fraction) {
  constexpr uint64_t kLanes = 0x0000ffff0000ffffull, kHalf = 0x0000800000008000ull;
  const uint64_t x1 = x_fraction, x0 = 256 - x1, y1 = y_fraction, y0 = 256 - y1;
  const uint64_t weights[4] = {x0 * y0, x1 * y0, x0 * y1, x1 * y1};
  uint64_t even = kHalf, odd = kHalf;
  for (int i = 0; i < 4; ++i) {
    even += (texels[i] & kLanes) * weights[i];
    odd += (texels[i] >> 16 & kLanes) * weights[i];
  }
  return (even >> 16 & kLanes) | (odd & ~kLanes);
}

// The four texels around a point.
struct TexelSquare {
  TexelPair x, y;
};

// Returns the texels around the texture coordinates (u, v). `view` is a level of an image.
template <class View>
VOXDAG_HD inline TexelSquare texels_around(const View& view, const Wrap (&wrap)[2], int64_t u,
                                           int64_t v) {
  return {texels_at(u, wrap[0], view.width()), texels_at(v, wrap[1], view.height())};
}

template <class View>
VOXDAG_HD inline Texel look_up(const View& view, const TexelSquare& at) {
  const Texel texels[4] = {view.texel(at.x.first, at.y.first), view.texel(at.x.second, at.y.first),
                           view.texel(at.x.first, at.y.second),
                           view.texel(at.x.second, at.y.second)};
  return blended(texels, at.x.fraction, at.y.fraction);
}

}  // namespace voxdag::color
