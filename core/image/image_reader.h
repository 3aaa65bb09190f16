// Reads a PNG or JPEG image row by row. Which of them it is, its first bytes tell. Profiles, gamma
// and orientation are ignored, as glTF wants it.
//
// Decoders: libpng, and libjpeg-turbo with its accurate integer transform and smooth upsampling.
// Whatever is wrong with the bytes, of any size that they claim, ends in BrokenImage. Not
// thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "core/base/memory_budget.h"

namespace voxdag {

// The bytes of an image file, from front to back.
class EncodedBytes {
 public:
  virtual ~EncodedBytes() = default;
  // Fills `out` and returns its size, or less where the bytes end.
  virtual size_t read(std::span<std::byte> out) = 0;
};

// Ends "<image> ...": "is a WebP image, expected PNG or JPEG".
struct BrokenImage {
  std::string message;
};

class ImageReader {
 public:
  // Wider and higher images are refused, and such of more pixels.
  static constexpr uint32_t kMaxEdge = 65535;
  static constexpr uint64_t kMaxPixels = uint64_t{1} << 28;
  // So is one whose decoder would need more memory than this.
  static constexpr uint64_t kMaxDecoderBytes = uint64_t{2} << 30;

  virtual ~ImageReader() = default;
  uint32_t width() const { return width_; }
  uint32_t height() const { return height_; }
  // Bits of a channel, 8 or 16.
  int bits() const { return bits_; }
  // The next row: red, green, blue, alpha of each pixel, bits() each, in the machine's byte order.
  // Throws BrokenImage and the source's errors.
  virtual void read_row(std::span<std::byte> row) = 0;

 protected:
  void check_size(uint64_t width, uint64_t height);

  uint32_t width_ = 0, height_ = 0;
  int bits_ = 8;
};

// For kSize, rows are not read, and no memory is taken for them.
enum class ImageUse { kPixels, kSize };

// The source must outlive the reader. Throws BrokenImage, Error{kOutOfMemory} if decoding does not
// fit the budget, and the source's errors.
std::unique_ptr<ImageReader> open_image(EncodedBytes& source, MemoryBudget& budget,
                                        ImageUse use = ImageUse::kPixels);

}  // namespace voxdag
