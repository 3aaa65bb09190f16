// Computes the stored color of a cell: the mean color of its surfaces, in sRGB.
#pragma once

#include <array>
#include <cstdint>

#include "core/base/host_device.h"
#include "core/color/color_sum.h"

namespace voxdag {

namespace color {

// Element i - 1 is the least linear intensity (65535 stands for 1.0) that is stored as i. It is
// ceil(65535 f((i - 1/2) / 255)) with the transfer function f of IEC 61966-2-1. All 255 arguments
// of the ceiling differ from an integer by more than 10^-6, so rounding errors do not change the
// table. Element 255 has no effect.
struct SrgbThresholds {
  uint16_t of[256] = {
      10,    30,    50,    70,    90,    110,   130,   150,   170,   189,   209,   230,   253,
      276,   301,   327,   354,   382,   412,   443,   475,   509,   544,   580,   618,   657,
      698,   740,   783,   828,   875,   923,   972,   1023,  1075,  1129,  1185,  1242,  1300,
      1360,  1422,  1486,  1551,  1617,  1685,  1755,  1827,  1900,  1975,  2052,  2130,  2210,
      2292,  2376,  2461,  2548,  2637,  2727,  2820,  2914,  3010,  3108,  3208,  3309,  3412,
      3518,  3625,  3734,  3844,  3957,  4072,  4188,  4307,  4427,  4550,  4674,  4800,  4928,
      5059,  5191,  5325,  5461,  5599,  5740,  5882,  6026,  6173,  6321,  6471,  6624,  6778,
      6935,  7094,  7255,  7418,  7583,  7750,  7919,  8091,  8265,  8440,  8618,  8798,  8981,
      9165,  9352,  9541,  9732,  9925,  10121, 10318, 10518, 10720, 10925, 11132, 11341, 11552,
      11765, 11981, 12199, 12420, 12643, 12868, 13095, 13325, 13557, 13791, 14028, 14267, 14508,
      14752, 14998, 15247, 15498, 15751, 16007, 16265, 16525, 16788, 17054, 17321, 17592, 17864,
      18139, 18417, 18697, 18980, 19264, 19552, 19842, 20134, 20429, 20727, 21027, 21329, 21634,
      21942, 22252, 22564, 22880, 23197, 23518, 23840, 24166, 24494, 24824, 25158, 25493, 25832,
      26173, 26516, 26862, 27211, 27563, 27917, 28273, 28633, 28995, 29359, 29727, 30097, 30469,
      30845, 31223, 31603, 31987, 32373, 32762, 33153, 33547, 33944, 34344, 34747, 35152, 35560,
      35970, 36384, 36800, 37219, 37640, 38065, 38492, 38922, 39355, 39790, 40229, 40670, 41114,
      41561, 42011, 42463, 42918, 43377, 43838, 44301, 44768, 45238, 45710, 46185, 46663, 47144,
      47628, 48115, 48605, 49097, 49593, 50091, 50592, 51096, 51604, 52114, 52627, 53142, 53661,
      54183, 54708, 55235, 55766, 56300, 56836, 57376, 57918, 58464, 59012, 59564, 60118, 60675,
      61236, 61799, 62366, 62935, 63508, 64083, 64662, 65244, 65535};
};
// Element k is for the intensities from 16 k to 16 k + 15. Its high byte is the stored value of 16
// k. Thresholds are more than 16 apart, so the other intensities have this value or the next one.
// The low byte is the number of intensities that have the stored value of 16 k.
struct SrgbSteps {
  uint16_t of[4096] = {};
  constexpr SrgbSteps() {
    constexpr SrgbThresholds kThresholds{};
    uint32_t stored = 0;
    for (uint32_t k = 0; k < 4096; ++k) {
      while (stored < 255 && kThresholds.of[stored] <= 16 * k) ++stored;
      uint32_t equal = 16;
      if (stored < 255 && kThresholds.of[stored] < 16 * k + 16)
        equal = kThresholds.of[stored] - 16 * k;
      of[k] = static_cast<uint16_t>(stored << 8 | equal);
    }
  }
};

// Returns the nearest value in sRGB: the number of thresholds that are <= `intensity`. Requires
// intensity <= 65535.
VOXDAG_HD inline uint8_t srgb_of(uint32_t intensity) {
  static constexpr SrgbSteps kSteps{};
  const uint32_t step = kSteps.of[intensity >> 4];
  return static_cast<uint8_t>((step >> 8) + ((intensity & 15) >= (step & 255)));
}

// Returns the middle of the intensities that are stored as `stored`. For 0 and 255, returns the
// ends of the range of intensities, 0 and 65535.
VOXDAG_HD inline uint32_t intensity_of(uint8_t stored) {
  static constexpr SrgbThresholds kThresholds{};
  if (stored == 0 || stored == 255) return stored == 0 ? 0 : 65535;
  return (uint32_t{kThresholds.of[stored - 1]} + kThresholds.of[stored]) / 2;
}

// Returns the quotient rounded to the nearest integer (half up).
VOXDAG_HD inline uint64_t rounded_quotient(uint64_t numerator, uint64_t denominator) {
  const uint64_t quotient = numerator / denominator, rest = numerator % denominator;
  return quotient + (rest >= denominator - rest ? 1 : 0);
}

// Returns the quotient rounded to the nearest integer (half up), computed in doubles. Requires a
// numerator below 2^52, a denominator below 2^35 and a quotient below 2^16. The result is exact: a
// quotient below k + 1/2, for an integer k, is at least 2^-36 below k + 1/2. Rounding it to a
// double keeps it below k + 1/2, because doubles below 2^16 are at most 2^-37 apart.
VOXDAG_HD inline uint32_t rounded_quotient_in_doubles(uint64_t numerator, double denominator) {
  const double quotient = static_cast<double>(static_cast<int64_t>(numerator)) / denominator;
  return static_cast<uint32_t>(static_cast<int32_t>(quotient + 0.5));
}

}  // namespace color

// Returns the mean alpha of a sum whose weight is above 0.
VOXDAG_HD inline uint8_t alpha_of(const ColorSum& sum) {
  if (sum.seen_weight == 255 * sum.weight) return 255;
  const uint64_t alpha = color::rounded_quotient(sum.seen_weight, sum.weight);
  return static_cast<uint8_t>(alpha < 255 ? alpha : 255);
}

// Returns the color of a sum whose weight is above 0: the mean over the surfaces, each weighted by
// its weight times its alpha. If all surfaces are transparent (alpha is 0), uses only their
// weights.
VOXDAG_HD inline Color color_of(const ColorSum& sum) {
  const bool visible = sum.seen_weight != 0;
  const std::array<uint64_t, 3>& channels = visible ? sum.seen : sum.plain;
  const uint64_t weight = visible ? sum.seen_weight : sum.weight;
  Color color;
  const bool is_small = ((channels[0] | channels[1] | channels[2]) >> 51 | weight >> 35) == 0;
  if (is_small && channels[0] <= 65535 * weight && channels[1] <= 65535 * weight &&
      channels[2] <= 65535 * weight) {
    const auto denominator = static_cast<double>(static_cast<int64_t>(weight));
    for (size_t c = 0; c < 3; ++c)
      color.rgb[c] = color::srgb_of(color::rounded_quotient_in_doubles(channels[c], denominator));
  } else {
    for (size_t c = 0; c < 3; ++c) {
      const uint64_t mean = color::rounded_quotient(channels[c], weight);
      color.rgb[c] = color::srgb_of(static_cast<uint32_t>(mean < 65535 ? mean : 65535));
    }
  }
  color.alpha = alpha_of(sum);
  return color;
}

// Returns the color_of() a sum of surfaces whose alpha is 255. `weight` is from 1 to 2^16, and
// `channels` are its sums of weight x intensity. A mean is rounded half up: it is the integer part
// of (channel + weight / 2) / weight. 1/4 is added to the numerator, so that the quotient is at
// least 2^-18 away from an integer, which exceeds the error of the rounded reciprocal.
VOXDAG_HD inline Color opaque_color_of(uint64_t weight, const std::array<uint64_t, 3>& channels) {
  const auto w = static_cast<double>(static_cast<int64_t>(weight));
  const double reciprocal = 1 / w, half = 0.5 * w + 0.25;
  Color color;
  for (size_t c = 0; c < 3; ++c) {
    const double mean =
        (static_cast<double>(static_cast<int64_t>(channels[c])) + half) * reciprocal;
    color.rgb[c] = color::srgb_of(static_cast<uint32_t>(static_cast<int32_t>(mean)));
  }
  return color;
}

}  // namespace voxdag
