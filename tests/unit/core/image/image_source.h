// Decodes images from memory.
#pragma once

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/image/image_reader.h"

namespace voxdag::test {

struct StringSource : EncodedBytes {
  explicit StringSource(std::string all) : bytes(std::move(all)) {}
  size_t read(std::span<std::byte> out) override {
    const size_t size = std::min(out.size(), bytes.size() - at);
    std::memcpy(out.data(), bytes.data() + at, size);
    at += size;
    return size;
  }
  const std::string bytes;
  size_t at = 0;
};

// Cancels a token when byte `cancel_at` is read.
struct CancelingSource : StringSource {
  CancelingSource(std::string all, size_t cancel_at_byte)
      : StringSource(std::move(all)), cancel_at(cancel_at_byte) {}
  size_t read(std::span<std::byte> out) override {
    const size_t size = StringSource::read(out);
    if (at > cancel_at) cancel.cancel();
    return size;
  }
  const size_t cancel_at;
  CancelToken cancel;
};

// Decodes a file, and cancels the decoder when it reads byte `cancel_at`.
inline void decode_canceled(const std::string& file, size_t cancel_at) {
  MemoryBudget budget(uint64_t{64} << 20);
  CancelingSource source(file, cancel_at);
  const auto reader = open_image(source, budget, ImageUse::kPixels, &source.cancel);
  std::vector<std::byte> row(size_t{4} * static_cast<size_t>(reader->bits()) / 8 * reader->width());
  for (uint32_t y = 0; y < reader->height(); ++y) reader->read_row(row);
}

struct Decoded {
  uint32_t width = 0, height = 0;
  int bits = 0;
  std::vector<uint16_t> channels;  // four per pixel
  std::array<uint16_t, 4> at(uint32_t x, uint32_t y) const {
    const uint16_t* const pixel = &channels[4 * (size_t{width} * y + x)];
    return {pixel[0], pixel[1], pixel[2], pixel[3]};
  }
};
using Pixel = std::array<uint16_t, 4>;

inline Decoded decode(const std::string& file, uint64_t memory = uint64_t{16} << 20) {
  MemoryBudget budget(memory);
  StringSource source(file);
  const auto reader = open_image(source, budget);
  Decoded out{reader->width(), reader->height(), reader->bits(), {}};
  const size_t channel_bytes = static_cast<size_t>(out.bits) / 8;
  std::vector<std::byte> row(4 * channel_bytes * out.width);
  for (uint32_t y = 0; y < out.height; ++y) {
    reader->read_row(row);
    for (size_t i = 0; i < row.size(); i += channel_bytes) {
      uint16_t value = std::to_integer<uint16_t>(row[i]);
      if (channel_bytes == 2) std::memcpy(&value, &row[i], 2);
      out.channels.push_back(value);
    }
  }
  return out;
}

// Returns the problem that the decoder reports; "" if it reports none.
inline std::string problem_of(const std::string& file, uint64_t memory = uint64_t{16} << 20) {
  try {
    decode(file, memory);
    return "";
  } catch (const BrokenImage& broken) {
    return broken.message;
  }
}

// Returns the pixels of a smooth image, which JPEG changes only little.
inline std::string gradient(uint32_t width, uint32_t height, uint32_t components) {
  std::string pixels;
  for (uint32_t y = 0; y < height; ++y)
    for (uint32_t x = 0; x < width; ++x)
      for (uint32_t c = 0; c < components; ++c)
        pixels += static_cast<char>(255 *
                                    (c == 0   ? x
                                     : c == 1 ? y
                                              : x + y) /
                                    (c < 2 ? std::max(width, height) : width + height));
  return pixels;
}
inline std::string noise(size_t size) {
  std::string bytes(size, '\0');
  uint32_t state = 7;
  for (char& c : bytes) c = static_cast<char>((state = state * 1664525 + 1013904223) >> 24);
  return bytes;
}

}  // namespace voxdag::test
