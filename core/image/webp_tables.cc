#include "core/image/webp_tables.h"

#include <algorithm>
#include <array>
#include <vector>

namespace voxdag {
namespace {

// RFC 9649, section 3.
constexpr uint32_t kLiterals = 256, kLengthCodes = 24, kDistanceCodes = 40;
constexpr uint32_t kMaxCacheBits = 11;
constexpr int kMaxCodeLength = 15;
// A set of libwebp's decoding tables has five tables and 64 packed entries. kGreenBytes: bytes of
// the green table, without its entries for the color cache. kSetBytes: bytes of the other four
// tables and of the packed entries.
constexpr uint64_t kSetBytes = 4 * 2300 + 1024, kGreenBytes = 4 * 654;

struct BrokenStream {};

class BitReader {
 public:
  explicit BitReader(std::span<const uint8_t> bytes) : bytes_(bytes) {}
  uint32_t read(uint32_t count) {
    uint32_t value = 0;
    for (uint32_t i = 0; i < count; ++i, ++at_) {
      if (at_ / 8 >= bytes_.size()) throw BrokenStream{};
      value |= (bytes_[at_ / 8] >> at_ % 8 & 1u) << i;
    }
    return value;
  }

 private:
  const std::span<const uint8_t> bytes_;
  size_t at_ = 0;  // position of the next bit
};

// A canonical prefix code. A code of one symbol has no bits.
class PrefixCode {
 public:
  explicit PrefixCode(std::span<const uint8_t> lengths) {
    for (const uint8_t length : lengths) ++count_[length];
    count_[0] = 0;
    std::array<uint32_t, kMaxCodeLength + 2> offset{};
    for (size_t i = 1; i <= kMaxCodeLength; ++i) offset[i + 1] = offset[i] + count_[i];
    symbols_.resize(offset.back());
    for (size_t i = 0; i < lengths.size(); ++i)
      if (lengths[i] > 0) symbols_[offset[lengths[i]]++] = static_cast<uint16_t>(i);
    if (symbols_.size() != 1 && !is_complete()) throw BrokenStream{};
  }
  uint32_t read(BitReader& bits) const {
    if (symbols_.size() == 1) return symbols_[0];
    uint32_t code = 0, first = 0, index = 0;
    for (size_t length = 1; length <= kMaxCodeLength; ++length) {
      code |= bits.read(1);
      if (code - first < count_[length]) return symbols_[index + code - first];
      index += count_[length];
      first = (first + count_[length]) << 1;
      code <<= 1;
    }
    throw BrokenStream{};
  }

 private:
  bool is_complete() const {
    uint32_t left = 1;
    for (size_t i = 1; i <= kMaxCodeLength; ++i) {
      if (2 * left < count_[i]) return false;
      left = 2 * left - count_[i];
    }
    return left == 0;
  }

  std::array<uint32_t, kMaxCodeLength + 1> count_{};
  std::vector<uint16_t> symbols_;
};

void read_code_lengths(BitReader& bits, std::span<uint8_t> lengths) {
  constexpr uint8_t kOrder[19] = {17, 18, 0, 1, 2, 3, 4, 5, 16, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
  constexpr uint32_t kExtraBits[3] = {2, 3, 7}, kMinRepeats[3] = {3, 3, 11};
  std::array<uint8_t, 19> own_lengths{};
  const uint32_t count = bits.read(4) + 4;
  if (count > own_lengths.size()) throw BrokenStream{};
  for (uint32_t i = 0; i < count; ++i) own_lengths[kOrder[i]] = static_cast<uint8_t>(bits.read(3));
  const PrefixCode code(own_lengths);
  size_t codes_left = lengths.size();
  if (bits.read(1)) codes_left = 2 + bits.read(2 + 2 * bits.read(3));
  uint8_t last = 8;
  for (size_t i = 0; i < lengths.size() && codes_left > 0; --codes_left) {
    const uint32_t length = code.read(bits);
    if (length <= kMaxCodeLength) {
      lengths[i++] = static_cast<uint8_t>(length);
      if (length > 0) last = static_cast<uint8_t>(length);
      continue;
    }
    const uint32_t kind = length - 16;
    const uint32_t repeats = kMinRepeats[kind] + bits.read(kExtraBits[kind]);
    if (repeats > lengths.size() - i) throw BrokenStream{};
    std::fill_n(&lengths[i], repeats, kind == 0 ? last : uint8_t{0});
    i += repeats;
  }
}

PrefixCode read_code(BitReader& bits, uint32_t alphabet) {
  std::vector<uint8_t> lengths(std::max(alphabet, kLiterals));
  if (bits.read(1)) {
    const uint32_t count = 1 + bits.read(1);
    lengths[bits.read(bits.read(1) ? 8 : 1)] = 1;
    if (count == 2) lengths[bits.read(8)] = 1;
  } else {
    read_code_lengths(bits, std::span(lengths).first(alphabet));
  }
  return PrefixCode(lengths);
}

// Returns the number of bits of an index in the color cache; 0 without a cache.
uint32_t read_cache_bits(BitReader& bits) {
  if (!bits.read(1)) return 0;
  const uint32_t cache_bits = bits.read(4);
  if (cache_bits == 0 || cache_bits > kMaxCacheBits) throw BrokenStream{};
  return cache_bits;
}
uint32_t cache_size(uint32_t cache_bits) { return cache_bits > 0 ? 1u << cache_bits : 0; }

// Reads the extra bits of a length or a distance whose prefix symbol is `symbol`, and returns the
// value. Throws BrokenStream for symbols that do not exist; a code of one or two symbols can
// contain them.
uint32_t read_copy_value(BitReader& bits, uint32_t symbol) {
  if (symbol >= kDistanceCodes) throw BrokenStream{};
  if (symbol < 4) return symbol + 1;
  const uint32_t extra = (symbol - 2) >> 1;
  return ((2 + (symbol & 1)) << extra) + bits.read(extra) + 1;
}

// Reads an image that is encoded with one set of codes. Returns the largest number that red (high
// byte) and green (low byte) of a pixel form. In the image that selects tables, this number is the
// index of a set of tables. Only literal pixels are compared, because copies and the color cache
// repeat earlier pixels.
uint32_t read_small_image(BitReader& bits, uint64_t pixels) {
  const uint32_t cache = cache_size(read_cache_bits(bits));
  const PrefixCode green = read_code(bits, kLiterals + kLengthCodes + cache),
                   red = read_code(bits, kLiterals), blue = read_code(bits, kLiterals),
                   alpha = read_code(bits, kLiterals), distance = read_code(bits, kDistanceCodes);
  uint32_t largest = 0;
  for (uint64_t i = 0; i < pixels;) {
    const uint32_t symbol = green.read(bits);
    if (symbol < kLiterals) {
      largest = std::max(largest, red.read(bits) << 8 | symbol);
      blue.read(bits);
      alpha.read(bits);
      ++i;
    } else if (symbol < kLiterals + kLengthCodes) {
      const uint32_t length = read_copy_value(bits, symbol - kLiterals);
      read_copy_value(bits, distance.read(bits));
      if (length > pixels - i) throw BrokenStream{};
      i += length;
    } else {
      ++i;
    }
  }
  return largest;
}

uint64_t reduced(uint64_t size, uint32_t bits) { return (size + (1u << bits) - 1) >> bits; }

// Reads a transform and adds its type to `seen`. Narrows `width` if the transform packs several
// pixels into one.
void read_transform(BitReader& bits, uint32_t& width, uint32_t height, uint32_t& seen) {
  enum : uint32_t { kPredictor = 0, kCrossColor = 1, kSubtractGreen = 2 };
  const uint32_t type = bits.read(2);
  if (seen >> type & 1) throw BrokenStream{};
  seen |= 1u << type;
  if (type == kSubtractGreen) return;
  if (type == kPredictor || type == kCrossColor) {
    const uint32_t block_bits = bits.read(3) + 2;
    read_small_image(bits, reduced(width, block_bits) * reduced(height, block_bits));
    return;
  }
  const uint32_t colors = bits.read(8) + 1;
  const uint32_t packed_bits = colors > 16 ? 0 : colors > 4 ? 1 : colors > 2 ? 2 : 3;
  read_small_image(bits, colors);
  width = static_cast<uint32_t>(reduced(width, packed_bits));
}

}  // namespace

std::optional<uint64_t> webp_table_bytes(std::span<const uint8_t> stream, uint32_t width,
                                         uint32_t height) {
  try {
    BitReader bits(stream);
    uint32_t seen = 0;  // a bit for each type of transform read so far
    while (bits.read(1)) read_transform(bits, width, height, seen);
    const uint32_t cache = cache_size(read_cache_bits(bits));
    uint64_t sets = 1;
    if (bits.read(1)) {
      const uint32_t block_bits = bits.read(3) + 2;
      sets += read_small_image(bits, reduced(width, block_bits) * reduced(height, block_bits));
    }
    return sets * (kSetBytes + kGreenBytes + 4 * uint64_t{cache});
  } catch (const BrokenStream&) {
    return std::nullopt;
  }
}

}  // namespace voxdag
