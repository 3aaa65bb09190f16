#include "scheduler/solid/row_codec.h"

#include <algorithm>

namespace voxdag {
namespace {

void put_varint(std::vector<std::byte>& out, uint64_t value) {
  for (; value >= 0x80; value >>= 7) out.push_back(static_cast<std::byte>(value | 0x80));
  out.push_back(static_cast<std::byte>(value));
}

class VarintSource {
 public:
  explicit VarintSource(std::span<const std::byte> bytes) : bytes_(bytes) {}
  bool is_empty() const { return next_ == bytes_.size(); }
  // Reads the next number. Returns false if it is incomplete or has more than ten bytes.
  bool get(uint64_t& value) {
    value = 0;
    for (int shift = 0; shift < 64 && next_ < bytes_.size(); shift += 7) {
      const auto byte = static_cast<uint64_t>(bytes_[next_++]);
      value |= (byte & 0x7f) << shift;
      if (byte < 0x80) return true;
    }
    return false;
  }

 private:
  std::span<const std::byte> bytes_;
  size_t next_ = 0;
};

// Maps a difference (modulo 2^32) to a number that is small if the difference is close to 0, above
// or below.
uint64_t zigzag(uint32_t difference) {
  return difference << 1 ^ (difference >> 31 != 0 ? UINT32_MAX : 0);
}
uint32_t unzigzag(uint64_t number) {
  return static_cast<uint32_t>(number >> 1) ^ ((number & 1) != 0 ? UINT32_MAX : 0);
}

}  // namespace

void encode_rows(std::span<const int32_t> numbers, std::vector<std::byte>& out) {
  int32_t previous = 0;
  for (size_t i = 0; i < numbers.size();) {
    const int32_t number = numbers[i];
    const auto begin = numbers.begin() + static_cast<std::ptrdiff_t>(i);
    const auto end = std::find_if(begin, numbers.end(), [&](int32_t n) { return n != number; });
    put_varint(out, zigzag(static_cast<uint32_t>(number) - static_cast<uint32_t>(previous)));
    put_varint(out, static_cast<uint64_t>(end - begin));
    i += static_cast<size_t>(end - begin);
    previous = number;
  }
}

bool decode_rows(std::span<const std::byte> bytes, std::span<int32_t> out) {
  VarintSource source(bytes);
  uint32_t number = 0;
  size_t at = 0;
  while (!source.is_empty()) {
    uint64_t difference, length;
    if (!source.get(difference) || !source.get(length) || length > out.size() - at) return false;
    number += unzigzag(difference);
    std::fill_n(out.begin() + static_cast<std::ptrdiff_t>(at), length,
                static_cast<int32_t>(number));
    at += length;
  }
  return at == out.size();
}

}  // namespace voxdag
