#include "scene/gltf/compressed/vertex_stream.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>

namespace voxdag::gltf {
namespace {

constexpr size_t kMaxStride = 256;
constexpr size_t kMaxBlockBytes = 8192;
constexpr size_t kMaxBlockElements = 256;
constexpr size_t kGroup = 16;  // elements whose deltas have the same number of bits
constexpr size_t kMinTailBytes = 24;
constexpr uint8_t kHeader = 0xa1;

// Forms in which a block stores the deltas of one byte of its elements.
enum Control : unsigned { kFewBits, kMoreBits, kZeros, kLiteral };

using Block = std::array<uint8_t, kMaxBlockBytes>;
using Element = std::array<uint8_t, kMaxStride>;

// The unread rest of a stream. After a read beyond the end, has_failed() is true and next() returns
// 0.
class Input {
 public:
  explicit Input(std::span<const std::byte> bytes) : bytes_(bytes) {}

  uint8_t next() {
    if (bytes_.empty()) failed_ = true;
    if (failed_) return 0;
    const auto byte = std::to_integer<uint8_t>(bytes_.front());
    bytes_ = bytes_.subspan(1);
    return byte;
  }
  void read(uint8_t* out, size_t count) {
    failed_ = failed_ || count > bytes_.size();
    if (failed_) return;
    std::memcpy(out, bytes_.data(), count);
    bytes_ = bytes_.subspan(count);
  }
  bool has_failed() const { return failed_; }
  size_t left() const { return bytes_.size(); }

 private:
  std::span<const std::byte> bytes_;
  bool failed_ = false;
};

// Reads 16 deltas of `bits` bits. If all bits of a delta are 1, its value follows as a byte.
void read_group(Input& in, unsigned bits, uint8_t* deltas) {
  if (bits == 0) return void(std::fill_n(deltas, kGroup, uint8_t{0}));
  if (bits == 8) return in.read(deltas, kGroup);
  const unsigned sentinel = (1u << bits) - 1;
  const unsigned per_byte = 8 / bits;
  std::array<uint8_t, kGroup / 2> packed{};
  in.read(packed.data(), kGroup / per_byte);
  for (unsigned i = 0; i < kGroup; ++i) {
    const unsigned place = i % per_byte;
    const unsigned shift = bits == 1 ? place : 8 - bits * (place + 1);
    const unsigned delta = packed[i / per_byte] >> shift & sentinel;
    deltas[i] = static_cast<uint8_t>(delta);
  }
  for (unsigned i = 0; i < kGroup; ++i)
    if (deltas[i] == sentinel) deltas[i] = in.next();
}

// Reads the deltas of one byte position for `count` elements. `deltas` needs space for a multiple
// of 16 deltas: they are stored in groups of 16, and the last group may extend beyond `count`.
void read_deltas(Input& in, unsigned control, size_t count, uint8_t* deltas) {
  if (control == kZeros) return void(std::fill_n(deltas, count, uint8_t{0}));
  if (control == kLiteral) return in.read(deltas, count);
  static constexpr unsigned kBits[2][4] = {{0, 1, 2, 4}, {1, 2, 4, 8}};
  const size_t groups = (count + kGroup - 1) / kGroup;
  std::array<uint8_t, kMaxBlockElements / kGroup / 4> modes{};
  in.read(modes.data(), (groups + 3) / 4);
  for (size_t g = 0; g < groups; ++g)
    read_group(in, kBits[control][modes[g / 4] >> 2 * (g % 4) & 3], deltas + g * kGroup);
}

template <class T>
T without_zigzag(T value) {
  return static_cast<T>(value & 1 ? ~(value >> 1) : value >> 1);
}

// Applies the deltas of one channel, which has four bytes of each element. `element` has the
// channel's bytes of the previous element. add_deltas() replaces them by the channel's bytes of the
// current element.
void add_deltas(unsigned mode, const std::array<uint8_t, 4>& delta, uint8_t* element) {
  const auto pair = [](const uint8_t* bytes) {
    return static_cast<uint16_t>(bytes[0] | bytes[1] << 8);
  };
  const auto quad = [](const uint8_t* bytes) {
    return static_cast<uint32_t>(bytes[0]) | static_cast<uint32_t>(bytes[1]) << 8 |
           static_cast<uint32_t>(bytes[2]) << 16 | static_cast<uint32_t>(bytes[3]) << 24;
  };
  const auto store = [&](size_t first, size_t bytes, uint32_t value) {
    for (size_t i = 0; i < bytes; ++i) element[first + i] = static_cast<uint8_t>(value >> 8 * i);
  };
  if (mode == 0)
    for (size_t i = 0; i < 4; ++i) store(i, 1, element[i] + 0u + without_zigzag(delta[i]));
  else if (mode == 1)
    for (size_t i = 0; i < 4; i += 2)
      store(i, 2, pair(element + i) + 0u + without_zigzag(pair(delta.data() + i)));
  else
    store(0, 4, quad(element) ^ std::rotr(quad(delta.data()), static_cast<int>(mode >> 4)));
}

bool is_channel_mode(uint8_t mode) { return (mode & 15) == 2 || mode < 2; }

// Reads a block of `count` elements. `last` is the element before the block; read_block() replaces
// it by the block's last element.
void read_block(Input& in, size_t stride, std::span<const uint8_t> channel_modes, size_t count,
                Element& last, std::byte* out) {
  Block deltas;
  std::array<uint8_t, kMaxStride / 4> control{};
  in.read(control.data(), stride / 4);
  const size_t rounded = (count + kGroup - 1) / kGroup * kGroup;
  for (size_t byte = 0; byte < stride; ++byte)
    read_deltas(in, control[byte / 4] >> 2 * (byte % 4) & 3, count, &deltas[byte * rounded]);
  if (in.has_failed()) return;
  for (size_t i = 0; i < count; ++i) {
    for (size_t byte = 0; byte < stride; byte += 4) {
      const uint8_t* const delta = &deltas[byte * rounded + i];
      add_deltas(channel_modes[byte / 4],
                 {delta[0], delta[rounded], delta[2 * rounded], delta[3 * rounded]}, &last[byte]);
    }
    std::memcpy(out + i * stride, last.data(), stride);
  }
}

}  // namespace

bool is_vertex_stream_1(std::span<const std::byte> stream) {
  return !stream.empty() && stream.front() == std::byte{kHeader};
}

bool decode_vertex_stream_1(std::span<const std::byte> stream, size_t stride,
                            std::span<std::byte> out) {
  const size_t tail_bytes = std::max(stride + stride / 4, kMinTailBytes);
  if (!is_vertex_stream_1(stream) || stream.size() < 1 + tail_bytes) return false;
  // The end of the stream, after the padding: the element to which the first deltas are added, and
  // the channel modes.
  Input tail(stream.last(stride + stride / 4));
  Element last;
  std::array<uint8_t, kMaxStride / 4> channel_modes;
  tail.read(last.data(), stride);
  tail.read(channel_modes.data(), stride / 4);
  if (!std::all_of(channel_modes.begin(), channel_modes.begin() + stride / 4, is_channel_mode))
    return false;
  const size_t block_elements =
      std::min((kMaxBlockBytes / stride) & ~(kGroup - 1), kMaxBlockElements);
  Input in(stream.subspan(1, stream.size() - 1 - tail_bytes));
  for (size_t left = out.size() / stride; left > 0 && !in.has_failed();) {
    const size_t count = std::min(left, block_elements);
    read_block(in, stride, channel_modes, count, last, out.data());
    out = out.subspan(count * stride);
    left -= count;
  }
  return !in.has_failed() && in.left() == 0;
}

}  // namespace voxdag::gltf
