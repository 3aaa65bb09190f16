// The encoder of color blocks (block_codec.h), in code that compilers vectorize. Each file that
// includes it is compiled for one instruction set. The file passes a local type as `Set`, so that
// the linker does not merge the functions of different instruction sets. For the same reason,
// nothing here calls inline functions that other files can also contain. The arithmetic uses
// integers, or doubles whose results are exact, so every instruction set gives the same bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "core/color/blocks/block_codec.h"

#define VOXDAG_INLINE __attribute__((always_inline)) inline

namespace voxdag {

// The two modes of a block (docs/format.md, "Color blocks"). Weights are 0 to kTop. pack() returns
// the bits that are stored for an end; unpack() returns the color that they decode to.
struct BlockModeA {
  static constexpr int32_t kTop = 7;
  VOXDAG_INLINE static uint32_t pack(const int32_t (&end)[3]) {
    return static_cast<uint32_t>((end[0] * 31 + 127) / 255 << 11 | (end[1] * 63 + 127) / 255 << 5 |
                                 (end[2] * 31 + 127) / 255);
  }
  VOXDAG_INLINE static void unpack(uint32_t bits, int32_t (&end)[3]) {
    const uint32_t r = bits >> 11, g = bits >> 5 & 63, b = bits & 31;
    end[0] = static_cast<int32_t>(r << 3 | r >> 2);
    end[1] = static_cast<int32_t>(g << 2 | g >> 4);
    end[2] = static_cast<int32_t>(b << 3 | b >> 2);
  }
};
struct BlockModeB {
  static constexpr int32_t kTop = 3;
  VOXDAG_INLINE static uint32_t pack(const int32_t (&end)[3]) {
    return static_cast<uint32_t>(end[0] << 16 | end[1] << 8 | end[2]);
  }
  VOXDAG_INLINE static void unpack(uint32_t bits, int32_t (&end)[3]) {
    end[0] = static_cast<int32_t>(bits >> 16);
    end[1] = static_cast<int32_t>(bits >> 8 & 255);
    end[2] = static_cast<int32_t>(bits & 255);
  }
};

template <class Set>
class BlockEncoder {
 public:
  static ColorBlock encode(const Color* colors, size_t count) {
    // Most blocks are full. With a constant count, compilers know the length of all loops.
    return count == kBlockCells ? encode_any(colors, kBlockCells) : encode_any(colors, count);
  }

 private:
  // The colors of a block, channel by channel, and their sums.
  struct Colors {
    alignas(64) int16_t value[3][kBlockCells];
    int32_t sum[3];
  };
  // Positions of the colors along an axis, from 0 to `range`.
  struct Projection {
    alignas(64) int32_t at[kBlockCells];
    int32_t range;
  };
  // The stored bits of the two ends, and a weight for each cell. Weight 0 is the color of the first
  // end, kTop the color of the second end.
  struct Fit {
    uint32_t ends[2];
    alignas(64) uint8_t weights[kBlockCells];
    int32_t error;  // sum of the squared differences from the block's colors
  };

  VOXDAG_INLINE static int32_t product_of(const int16_t* a, const int16_t* b, size_t count) {
    int32_t sum = 0;
    for (size_t i = 0; i < count; ++i) sum += static_cast<int32_t>(a[i]) * b[i];
    return sum;
  }

  VOXDAG_INLINE static ColorBlock encode_any(const Color* colors, size_t count) {
    Colors block;
    int32_t differences = 0;
    for (size_t i = 0; i < count; ++i)
      for (size_t c = 0; c < 3; ++c) {
        const int16_t value = reinterpret_cast<const uint8_t*>(&colors[i])[c];
        block.value[c][i] = value;
        differences |= value ^ reinterpret_cast<const uint8_t*>(&colors[0])[c];
      }
    if (differences == 0) {
      const int32_t only[3] = {block.value[0][0], block.value[1][0], block.value[2][0]};
      const uint64_t end = BlockModeB::pack(only);
      return words(end << 16 | end << 40, 0);
    }
    Projection projection;
    project_to_principal_axis(block, count, projection);
    Fit b;
    fit<BlockModeB>(block, count, projection, b);
    if (b.error == 0) return pack_b(b);
    Fit a;
    fit<BlockModeA>(block, count, projection, a);
    // A decoder recognizes mode B by 0 in the first 16 bits, where mode A stores its first end. The
    // first end is the larger one, so it is not 0 if the ends differ.
    return a.error < b.error && a.ends[0] != a.ends[1] ? pack_a(a) : pack_b(b);
  }

  VOXDAG_INLINE static void project(const Colors& colors, size_t count, const int32_t (&axis)[3],
                                    Projection& out) {
    int32_t low = INT32_MAX, high = INT32_MIN;
    for (size_t i = 0; i < count; ++i) {
      const int32_t at = axis[0] * colors.value[0][i] + axis[1] * colors.value[1][i] +
                         axis[2] * colors.value[2][i];
      out.at[i] = at;
      low = at < low ? at : low;
      high = at > high ? at : high;
    }
    for (size_t i = 0; i < count; ++i) out.at[i] -= low;
    out.range = high - low;
  }

  // Sets `axis` to `from`, divided by a power of two so that no component has more than 10 bits,
  // and rounded toward 0. Returns false if `from` is zero; `axis` is then unchanged.
  VOXDAG_INLINE static bool normalize(const int64_t (&from)[3], int32_t (&axis)[3]) {
    uint64_t largest = 0;
    for (const int64_t f : from) largest |= static_cast<uint64_t>(f < 0 ? -f : f);
    if (largest == 0) return false;
    const int bits = 64 - __builtin_clzll(largest), shift = bits > 10 ? bits - 10 : 0;
    for (int c = 0; c < 3; ++c) {
      const int64_t up = (from[c] >> 63) & ((int64_t{1} << shift) - 1);
      axis[c] = static_cast<int32_t>((from[c] + up) >> shift);
    }
    return true;
  }

  // Projects the colors to their principal axis. The colors must not all be equal.
  VOXDAG_INLINE static void project_to_principal_axis(Colors& colors, size_t count,
                                                      Projection& out) {
    constexpr int kSteps = 4;
    const auto n = static_cast<int32_t>(count);
    for (int c = 0; c < 3; ++c) {
      int32_t sum = 0;
      for (size_t i = 0; i < count; ++i) sum += colors.value[c][i];
      colors.sum[c] = sum;
    }
    int64_t covariance[3][3];
    for (int a = 0; a < 3; ++a)
      for (int b = 0; b <= a; ++b)
        covariance[a][b] = covariance[b][a] =
            n * product_of(colors.value[a], colors.value[b], count) - colors.sum[a] * colors.sum[b];
    int widest = 0;
    for (int c = 1; c < 3; ++c)
      if (covariance[c][c] > covariance[widest][widest]) widest = c;
    int32_t axis[3] = {};
    int64_t next[3] = {covariance[widest][0], covariance[widest][1], covariance[widest][2]};
    for (int step = 0; step < kSteps && normalize(next, axis); ++step)
      for (int a = 0; a < 3; ++a)
        next[a] =
            covariance[a][0] * axis[0] + covariance[a][1] * axis[1] + covariance[a][2] * axis[2];
    normalize(next, axis);
    project(colors, count, axis, out);
    if (out.range > 0) return;
    // All colors have the same position, because the rounded axis is orthogonal to all differences
    // of colors. Uses the channel with the largest variance as the axis instead.
    for (int c = 0; c < 3; ++c) axis[c] = c == widest;
    project(colors, count, axis, out);
  }

  // Sets `ends` by least squares. For this, each color has the weight, from 0 to `top`, that is
  // nearest to its position on the axis. The weights 0 and `top` occur, so the determinant is not
  // 0.
  VOXDAG_INLINE static void fit_ends(const Colors& colors, size_t count,
                                     const Projection& projection, int32_t top,
                                     int32_t (&ends)[2][3]) {
    const int bits = 32 - __builtin_clz(static_cast<uint32_t>(projection.range));
    const int shift = bits > 12 ? bits - 12 : 0;
    const int32_t scale = (top << 16) / (projection.range >> shift);
    alignas(64) int16_t k[kBlockCells];
    int32_t sum = 0;
    for (size_t i = 0; i < count; ++i) {
      const int32_t weight = ((projection.at[i] >> shift) * scale + (1 << 15)) >> 16;
      k[i] = static_cast<int16_t>(weight);
      sum += weight;
    }
    // Sums over the cells' weights k: of k^2, of k (top - k), and of (top - k)^2.
    const auto n = static_cast<int32_t>(count);
    const int32_t second_squares = product_of(k, k, count);
    const int32_t mixed = top * sum - second_squares;
    const int32_t first_squares = top * (top * n - sum) - mixed;
    const int32_t determinant = first_squares * second_squares - mixed * mixed;
    // Numerators are below 2^27 and are multiplied by at most 14 here, so they have 31 bits. The
    // integer part is exact: a quotient of two 31-bit numbers that is not an integer is never
    // rounded up to an integer in doubles.
    const double divisor = 2 * determinant;
    for (int c = 0; c < 3; ++c) {
      const int32_t second = product_of(k, colors.value[c], count);
      const int32_t first = top * colors.sum[c] - second;
      const int32_t numerators[2] = {second_squares * first - mixed * second,
                                     first_squares * second - mixed * first};
      for (int e = 0; e < 2; ++e) {
        const int32_t rounded = 2 * top * numerators[e] + determinant;
        const auto end =
            static_cast<int32_t>(static_cast<double>(rounded > 0 ? rounded : 0) / divisor);
        ends[e][c] = end < 255 ? end : 255;
      }
    }
  }

  // Gives each color the weight of the nearest point between the ends, and sums the errors.
  VOXDAG_INLINE static void choose_weights(const Colors& colors, size_t count,
                                           const int32_t (&ends)[2][3], int32_t top, Fit& out) {
    int32_t along[3], start = 0, square = 0;
    for (int c = 0; c < 3; ++c) {
      along[c] = ends[1][c] - ends[0][c];
      square += along[c] * along[c];
      start += along[c] * ends[0][c];
    }
    const int32_t scale = square == 0 ? 0 : (top << 28) / square;
    alignas(64) uint16_t weights[kBlockCells];
    for (size_t i = 0; i < count; ++i) {
      int32_t at = along[0] * colors.value[0][i] + along[1] * colors.value[1][i] +
                   along[2] * colors.value[2][i] - start;
      at = at < 0 ? 0 : at;
      at = at > square ? square : at;
      weights[i] = static_cast<uint16_t>((at * scale + (1 << 27)) >> 28);
      out.weights[i] = static_cast<uint8_t>(weights[i]);
    }
    for (size_t i = count; i < kBlockCells; ++i) out.weights[i] = 0;
    // Weight k decodes to (first (top - k) + second k + top / 2) / top, rounded down.
    const auto divisor = static_cast<uint16_t>(top);
    int32_t error = 0;
    for (int c = 0; c < 3; ++c) {
      const auto first = static_cast<uint16_t>(ends[0][c] * top + top / 2);
      const auto step = static_cast<uint16_t>(along[c]);  // wraps around if negative
      alignas(64) int16_t differences[kBlockCells];
      for (size_t i = 0; i < count; ++i) {
        const auto decoded =
            static_cast<uint16_t>(static_cast<uint16_t>(first + step * weights[i]) / divisor);
        differences[i] = static_cast<int16_t>(colors.value[c][i] - decoded);
      }
      error += product_of(differences, differences, count);
    }
    out.error = error;
  }

  // Fits ends and weights for a mode. The first end is the end with the larger stored bits.
  template <class Mode>
  VOXDAG_INLINE static void fit(const Colors& colors, size_t count, const Projection& projection,
                                Fit& out) {
    int32_t ends[2][3];
    fit_ends(colors, count, projection, Mode::kTop, ends);
    const uint32_t first = Mode::pack(ends[0]), second = Mode::pack(ends[1]);
    out.ends[0] = first < second ? second : first;
    out.ends[1] = first < second ? first : second;
    for (int e = 0; e < 2; ++e) Mode::unpack(out.ends[e], ends[e]);
    choose_weights(colors, count, ends, Mode::kTop, out);
  }

  // Returns eight weights as the bytes of one number, the first weight in the lowest byte.
  VOXDAG_INLINE static uint64_t eight(const uint8_t* weights) {
    uint64_t all = 0;
    for (int i = 0; i < 8; ++i) all |= uint64_t{weights[i]} << 8 * i;
    return all;
  }
  VOXDAG_INLINE static ColorBlock pack_a(const Fit& fit) {
    uint64_t parts[4];
    for (int i = 0; i < 4; ++i) {
      uint64_t x = eight(fit.weights + 8 * i);
      x = (x | x >> 5) & 0x003f003f003f003full;
      x = (x | x >> 10) & 0x00000fff00000fffull;
      parts[i] = (x | x >> 20) & 0xffffff;
    }
    return words(fit.ends[0] | uint64_t{fit.ends[1]} << 16 | parts[0] << 32 | parts[1] << 56,
                 parts[1] >> 8 | parts[2] << 16 | parts[3] << 40);
  }
  VOXDAG_INLINE static ColorBlock pack_b(const Fit& fit) {
    uint64_t high = 0;
    for (int i = 0; i < 4; ++i) {
      uint64_t x = eight(fit.weights + 8 * i);
      x = (x | x >> 6) & 0x000f000f000f000full;
      x = (x | x >> 12) & 0x000000ff000000ffull;
      high |= ((x | x >> 24) & 0xffff) << 16 * i;
    }
    return words(uint64_t{fit.ends[0]} << 16 | uint64_t{fit.ends[1]} << 40, high);
  }
  VOXDAG_INLINE static ColorBlock words(uint64_t low, uint64_t high) {
    ColorBlock block;
    auto* const bytes = reinterpret_cast<uint8_t*>(&block);
    for (int i = 0; i < 8; ++i) {
      bytes[i] = static_cast<uint8_t>(low >> 8 * i);
      bytes[8 + i] = static_cast<uint8_t>(high >> 8 * i);
    }
    return block;
  }
};

}  // namespace voxdag
