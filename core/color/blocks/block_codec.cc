#include "core/color/blocks/block_codec.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <utility>

namespace voxdag {
namespace {

using Channels = std::array<int32_t, 3>;

// The colors of a block, channel by channel.
struct BlockColors {
  int32_t value[3][kBlockCells];
  size_t count;
};

// Two ends and a weight for each cell: 0 is the first end, `top` the second.
struct Fit {
  std::array<Channels, 2> ends{};
  std::array<uint8_t, kBlockCells> weights{};
  int64_t error = 0;  // the sum of squared differences
};

// The weights are 0 to kTop; an end is what its stored bits decode to.
struct ModeA {
  static constexpr int32_t kTop = 7;
  static uint32_t pack(const Channels& end) {
    const auto quantize = [](int32_t value, int32_t top) {
      return static_cast<uint32_t>((value * top + 127) / 255);
    };
    return quantize(end[0], 31) << 11 | quantize(end[1], 63) << 5 | quantize(end[2], 31);
  }
  static Channels unpack(uint32_t bits) {
    const uint32_t r = bits >> 11, g = bits >> 5 & 63, b = bits & 31;
    return {static_cast<int32_t>(r << 3 | r >> 2), static_cast<int32_t>(g << 2 | g >> 4),
            static_cast<int32_t>(b << 3 | b >> 2)};
  }
};
struct ModeB {
  static constexpr int32_t kTop = 3;
  static uint32_t pack(const Channels& end) {
    return static_cast<uint32_t>(end[0] << 16 | end[1] << 8 | end[2]);
  }
  static Channels unpack(uint32_t bits) {
    return {static_cast<int32_t>(bits >> 16), static_cast<int32_t>(bits >> 8 & 255),
            static_cast<int32_t>(bits & 255)};
  }
};

// Where the colors lie along an axis, from 0 to `range`.
struct Projection {
  int32_t at[kBlockCells];
  int32_t range;
};

Projection project(const BlockColors& colors, const Channels& axis) {
  Projection result;
  int32_t low = INT32_MAX, high = INT32_MIN;
  for (size_t i = 0; i < colors.count; ++i) {
    const int32_t at =
        axis[0] * colors.value[0][i] + axis[1] * colors.value[1][i] + axis[2] * colors.value[2][i];
    result.at[i] = at;
    low = std::min(low, at);
    high = std::max(high, at);
  }
  for (size_t i = 0; i < colors.count; ++i) result.at[i] -= low;
  result.range = high - low;
  return result;
}

// Shortens the axis until its components have 10 bits. False if nothing is left.
bool normalize(const std::array<int64_t, 3>& from, Channels& axis) {
  uint64_t largest = 0;
  for (const int64_t f : from) largest = std::max(largest, static_cast<uint64_t>(f < 0 ? -f : f));
  if (largest == 0) return false;
  const int shift = std::max(0, static_cast<int>(std::bit_width(largest)) - 10);
  for (size_t c = 0; c < 3; ++c) axis[c] = static_cast<int32_t>(from[c] / (int64_t{1} << shift));
  return true;
}

// The colors along their principal axis. They must not all be equal.
Projection project_to_principal_axis(const BlockColors& colors) {
  constexpr int kSteps = 4;
  const auto n = static_cast<int32_t>(colors.count);
  int32_t sum[3] = {}, product[3][3] = {};
  for (size_t a = 0; a < 3; ++a) {
    for (size_t i = 0; i < colors.count; ++i) sum[a] += colors.value[a][i];
    for (size_t b = 0; b <= a; ++b)
      for (size_t i = 0; i < colors.count; ++i)
        product[a][b] += colors.value[a][i] * colors.value[b][i];
  }
  int64_t covariance[3][3];
  for (size_t a = 0; a < 3; ++a)
    for (size_t b = 0; b <= a; ++b)
      covariance[a][b] = covariance[b][a] = n * product[a][b] - sum[a] * sum[b];
  size_t widest = 0;
  for (size_t c = 1; c < 3; ++c)
    if (covariance[c][c] > covariance[widest][widest]) widest = c;
  Channels axis{};
  std::array<int64_t, 3> next{covariance[widest][0], covariance[widest][1], covariance[widest][2]};
  for (int step = 0; step < kSteps && normalize(next, axis); ++step)
    for (size_t a = 0; a < 3; ++a)
      next[a] =
          covariance[a][0] * axis[0] + covariance[a][1] * axis[1] + covariance[a][2] * axis[2];
  normalize(next, axis);
  Projection result = project(colors, axis);
  if (result.range > 0) return result;
  axis = {};  // rounding turned it away from all differences
  axis[widest] = 1;
  return project(colors, axis);
}

// The ends that least squares finds for the weights which the colors' places along the axis are
// nearest to. Each weight is at most `top`, 0 and `top` occur, so that the determinant is not 0.
std::array<Channels, 2> fit_ends(const BlockColors& colors, const Projection& projection,
                                 int32_t top) {
  const int shift =
      std::max(0, static_cast<int>(std::bit_width(static_cast<uint32_t>(projection.range))) - 12);
  const int32_t scale = (top << 16) / (projection.range >> shift);
  int32_t first_squares = 0, mixed = 0, second_squares = 0;
  int32_t first[3] = {}, second[3] = {};
  for (size_t i = 0; i < colors.count; ++i) {
    const int32_t k = ((projection.at[i] >> shift) * scale + (1 << 15)) >> 16;
    first_squares += (top - k) * (top - k);
    mixed += k * (top - k);
    second_squares += k * k;
    for (size_t c = 0; c < 3; ++c) {
      first[c] += (top - k) * colors.value[c][i];
      second[c] += k * colors.value[c][i];
    }
  }
  const int32_t determinant = first_squares * second_squares - mixed * mixed;
  const auto end = [&](int32_t numerator) {
    const int64_t rounded =
        std::max<int64_t>(0, int64_t{2} * top * numerator + determinant) / (2 * determinant);
    return static_cast<int32_t>(std::min<int64_t>(rounded, 255));
  };
  std::array<Channels, 2> ends;
  for (size_t c = 0; c < 3; ++c) {
    ends[0][c] = end(second_squares * first[c] - mixed * second[c]);
    ends[1][c] = end(first_squares * second[c] - mixed * first[c]);
  }
  return ends;
}

// What weight k between the ends decodes to. Symmetric: exchanged ends give the same colors.
Channels mix(const std::array<Channels, 2>& ends, int32_t k, int32_t top) {
  Channels mixed;
  for (size_t c = 0; c < 3; ++c)
    mixed[c] = (ends[0][c] * (top - k) + ends[1][c] * k + top / 2) / top;
  return mixed;
}

// Gives each color the weight of the nearest point between the ends, and adds up the errors.
void choose_weights(const BlockColors& colors, int32_t top, Fit& fit) {
  Channels along;
  int32_t square = 0;
  for (size_t c = 0; c < 3; ++c) {
    along[c] = fit.ends[1][c] - fit.ends[0][c];
    square += along[c] * along[c];
  }
  const int32_t scale = square == 0 ? 0 : (top << 28) / square;
  Channels palette[ModeA::kTop + 1];
  for (int32_t k = 0; k <= top; ++k) palette[k] = mix(fit.ends, k, top);
  int32_t weights[kBlockCells];
  for (size_t i = 0; i < colors.count; ++i) {
    int32_t at = 0;
    for (size_t c = 0; c < 3; ++c) at += along[c] * (colors.value[c][i] - fit.ends[0][c]);
    weights[i] = (std::clamp(at, 0, square) * scale + (1 << 27)) >> 28;
  }
  int32_t error = 0;
  for (size_t i = 0; i < colors.count; ++i) {
    fit.weights[i] = static_cast<uint8_t>(weights[i]);
    const Channels& decoded = palette[weights[i]];
    for (size_t c = 0; c < 3; ++c) {
      const int32_t difference = colors.value[c][i] - decoded[c];
      error += difference * difference;
    }
  }
  fit.error = error;
}

// The ends are in the order of their bits, the larger first.
template <class Mode>
Fit fit_mode(const BlockColors& colors, const Projection& projection) {
  Fit fit{fit_ends(colors, projection, Mode::kTop)};
  uint32_t bits[2] = {Mode::pack(fit.ends[0]), Mode::pack(fit.ends[1])};
  if (bits[0] < bits[1]) std::swap(bits[0], bits[1]);
  fit.ends = {Mode::unpack(bits[0]), Mode::unpack(bits[1])};
  choose_weights(colors, Mode::kTop, fit);
  return fit;
}

ColorBlock pack_words(uint64_t low, uint64_t high) {
  ColorBlock block;
  for (size_t i = 0; i < 8; ++i) {
    block[i] = static_cast<std::byte>(low >> 8 * i & 255);
    block[8 + i] = static_cast<std::byte>(high >> 8 * i & 255);
  }
  return block;
}

ColorBlock pack_a(const Fit& fit, size_t count) {
  uint64_t low = ModeA::pack(fit.ends[0]) | uint64_t{ModeA::pack(fit.ends[1])} << 16, high = 0;
  for (size_t i = 0; i < count; ++i) {
    const size_t bit = 32 + 3 * i;
    const uint64_t weight = fit.weights[i];
    if (bit < 64) low |= weight << bit;
    if (bit + 3 > 64) high |= bit < 64 ? weight >> (64 - bit) : weight << (bit - 64);
  }
  return pack_words(low, high);
}

ColorBlock pack_b(const Fit& fit, size_t count) {
  const uint64_t low = uint64_t{ModeB::pack(fit.ends[0])} << 16 | uint64_t{ModeB::pack(fit.ends[1])}
                                                                      << 40;
  uint64_t high = 0;
  for (size_t i = 0; i < count; ++i) high |= uint64_t{fit.weights[i]} << 2 * i;
  return pack_words(low, high);
}

}  // namespace

ColorBlock encode_block(std::span<const Color> colors) {
  BlockColors block;
  block.count = colors.size();
  bool flat = true;
  for (size_t i = 0; i < colors.size(); ++i) {
    for (size_t c = 0; c < 3; ++c) block.value[c][i] = colors[i].rgb[c];
    flat = flat && colors[i].rgb == colors[0].rgb;
  }
  if (flat) {
    const Channels only{block.value[0][0], block.value[1][0], block.value[2][0]};
    return pack_b(Fit{{only, only}}, colors.size());
  }
  const Projection projection = project_to_principal_axis(block);
  const Fit b = fit_mode<ModeB>(block, projection);
  if (b.error == 0) return pack_b(b, colors.size());
  const Fit a = fit_mode<ModeA>(block, projection);
  // Equal ends would look like mode B.
  if (a.error < b.error && a.ends[0] != a.ends[1]) return pack_a(a, colors.size());
  return pack_b(b, colors.size());
}

}  // namespace voxdag
