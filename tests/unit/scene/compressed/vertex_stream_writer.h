// Writes vertex streams of version 1 (KHR_meshopt_compression, appendix A, mode 0). The seed
// decides how the deltas are stored, so that all forms occur.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

namespace voxdag::test {

// Appends a group of 16 deltas with `bits` bits each. Deltas that do not fit are marked by the
// largest value, and follow as complete bytes.
inline void write_group(std::vector<unsigned char>& out, const std::array<uint8_t, 16>& deltas,
                        unsigned bits) {
  if (bits == 0) return;
  if (bits == 8) return void(out.insert(out.end(), deltas.begin(), deltas.end()));
  const unsigned sentinel = (1u << bits) - 1, per_byte = 8 / bits;
  std::vector<unsigned char> packed(16 / per_byte), whole;
  for (unsigned i = 0; i < 16; ++i) {
    const unsigned shift = bits == 1 ? i % 8 : 8 - bits - bits * (i % per_byte);
    const unsigned value = std::min<unsigned>(deltas[i], sentinel);
    packed[i / per_byte] = static_cast<unsigned char>(packed[i / per_byte] | value << shift);
    if (value == sentinel) whole.push_back(deltas[i]);
  }
  out.insert(out.end(), packed.begin(), packed.end());
  out.insert(out.end(), whole.begin(), whole.end());
}

// Returns the deltas of a channel, which is four bytes of each element, from element `before` to
// element `now`. Mode 0 subtracts bytes, mode 1 subtracts 16-bit numbers, and other modes XOR and
// rotate 32-bit numbers by mode >> 4 bits.
inline std::array<uint8_t, 4> channel_delta(const uint8_t* before, const uint8_t* now,
                                            unsigned mode) {
  std::array<uint8_t, 4> delta{};
  if (mode == 0)
    for (size_t i = 0; i < 4; ++i) {
      const auto d = static_cast<uint8_t>(now[i] - before[i]);
      delta[i] = static_cast<uint8_t>(d & 0x80 ? ~(d << 1) : d << 1);
    }
  else if (mode == 1)
    for (size_t i = 0; i < 4; i += 2) {
      const auto d =
          static_cast<uint16_t>((now[i] | now[i + 1] << 8) - (before[i] | before[i + 1] << 8));
      const auto z = static_cast<uint16_t>(d & 0x8000 ? ~(d << 1) : d << 1);
      delta[i] = static_cast<uint8_t>(z);
      delta[i + 1] = static_cast<uint8_t>(z >> 8);
    }
  else {
    uint32_t x = 0;
    for (size_t i = 0; i < 4; ++i) x |= static_cast<uint32_t>(now[i] ^ before[i]) << 8 * i;
    const unsigned turn = mode >> 4;
    x = turn == 0 ? x : x << turn | x >> (32 - turn);
    for (size_t i = 0; i < 4; ++i) delta[i] = static_cast<uint8_t>(x >> 8 * i);
  }
  return delta;
}

// Returns the stream of the elements in `bytes`, which have `stride` bytes each. `modes` has one
// channel mode for every four bytes of an element.
inline std::vector<unsigned char> write_vertex_stream_1(const std::string& bytes, size_t stride,
                                                        const std::vector<uint8_t>& modes,
                                                        unsigned seed) {
  static constexpr unsigned kBits[2][4] = {{0, 1, 2, 4}, {1, 2, 4, 8}};
  std::mt19937 random(seed);
  std::vector<unsigned char> out = {0xa1};
  const size_t elements = bytes.size() / stride;
  const size_t per_block = std::min<size_t>(8192 / stride & ~size_t{15}, 256);
  std::vector<uint8_t> baseline(stride);
  for (uint8_t& byte : baseline) byte = static_cast<uint8_t>(random());
  const auto* const all = reinterpret_cast<const uint8_t*>(bytes.data());
  const auto element = [&](size_t i) { return all + i * stride; };
  for (size_t first = 0; first < elements; first += per_block) {
    const size_t count = std::min(per_block, elements - first);
    const size_t groups = (count + 15) / 16;
    std::vector<std::vector<uint8_t>> deltas(stride, std::vector<uint8_t>(16 * groups));
    for (size_t i = 0; i < count; ++i)
      for (size_t byte = 0; byte < stride; byte += 4) {
        const uint8_t* const before = first + i == 0 ? baseline.data() : element(first + i - 1);
        const auto delta = channel_delta(before + byte, element(first + i) + byte, modes[byte / 4]);
        for (size_t k = 0; k < 4; ++k) deltas[byte + k][i] = delta[k];
      }
    const size_t controls = out.size();
    out.insert(out.end(), stride / 4, 0);
    for (size_t byte = 0; byte < stride; ++byte) {
      const bool all_zero = std::ranges::all_of(deltas[byte], [](uint8_t d) { return d == 0; });
      const unsigned control = all_zero && random() % 2 ? 2 : std::array{0u, 1u, 3u}[random() % 3];
      out[controls + byte / 4] |= static_cast<unsigned char>(control << 2 * (byte % 4));
      if (control == 2) continue;
      if (control == 3) {
        out.insert(out.end(), deltas[byte].begin(),
                   deltas[byte].begin() + static_cast<ptrdiff_t>(count));
        continue;
      }
      const size_t header = out.size();
      out.insert(out.end(), (groups + 3) / 4, 0);
      for (size_t g = 0; g < groups; ++g) {
        std::array<uint8_t, 16> group;
        std::copy_n(deltas[byte].begin() + static_cast<ptrdiff_t>(16 * g), 16, group.begin());
        const bool is_zero = std::ranges::all_of(group, [](uint8_t d) { return d == 0; });
        unsigned mode = random() % 4;
        if (kBits[control][mode] == 0 && !is_zero) mode = 1 + random() % 3;
        out[header + g / 4] |= static_cast<unsigned char>(mode << 2 * (g % 4));
        write_group(out, group, kBits[control][mode]);
      }
    }
  }
  const size_t tail = stride + stride / 4;
  out.insert(out.end(), tail < 24 ? 24 - tail : 0, 0);
  out.insert(out.end(), baseline.begin(), baseline.end());
  out.insert(out.end(), modes.begin(), modes.end());
  return out;
}

}  // namespace voxdag::test
