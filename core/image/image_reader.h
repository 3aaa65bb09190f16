// Reads a PNG, JPEG, WebP or AVIF image row by row. Detects the format by its first bytes. Ignores
// profiles, gamma and orientation, as glTF requires.
//
// Decoders: libpng, libjpeg-turbo with its accurate integer transform and smooth upsampling, and,
// if voxdag was built with them, libwebp and libavif. The first read_row() of a WebP or AVIF image
// decodes the complete image, in memory that is charged to the budget. All invalid bytes cause
// BrokenImage, whatever image size they declare. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "core/base/memory_budget.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

// A source of the bytes of an image file, which are read in order.
class EncodedBytes {
 public:
  virtual ~EncodedBytes() = default;
  // Fills the front of `out`. Returns the number of bytes read, which is less than out.size() only
  // at the end.
  virtual size_t read(std::span<std::byte> out) = 0;
};

// Thrown for an image that cannot be decoded. The caller puts the name of the image before the
// message, for example "is a GIF image, which voxdag does not read: convert it to PNG".
struct BrokenImage {
  std::string message;
};

class ImageReader {
 public:
  // Maximum width and height, and maximum number of pixels. Larger images are refused.
  static constexpr uint32_t kMaxEdge = 65535;
  static constexpr uint64_t kMaxPixels = uint64_t{1} << 28;
  // Maximum memory of a decoder, in bytes. Images that need more are refused.
  static constexpr uint64_t kMaxDecoderBytes = uint64_t{2} << 30;

  virtual ~ImageReader() = default;
  uint32_t width() const { return width_; }
  uint32_t height() const { return height_; }
  // Bits of a channel, 8 or 16.
  int bits() const { return bits_; }
  // Reads the next row: red, green, blue and alpha of each pixel, bits() bits each, in the
  // machine's byte order. `row` must have exactly the size of a row. Throws BrokenImage and the
  // errors of the source.
  virtual void read_row(std::span<std::byte> row) = 0;

 protected:
  // Sets width_ and height_. Throws BrokenImage if they are 0 or exceed the limits.
  void check_size(uint64_t width, uint64_t height);

  uint32_t width_ = 0, height_ = 0;
  int bits_ = 8;
};

// With kSize, only the image's size can be read. The reader then does not allocate the memory for
// decoding a JPEG or for all rows of an interlaced PNG.
enum class ImageUse { kPixels, kSize };

// Opens an image and reads its header. The source and `cancel` must outlive the reader. Throws
// BrokenImage, Error{kOutOfMemory} if decoding does not fit the budget, and the errors of the
// source. The reader checks `cancel` while it decodes PNG and JPEG images, and before it decodes
// WebP and AVIF images, whose libraries cannot be stopped.
std::unique_ptr<ImageReader> open_image(EncodedBytes& source, MemoryBudget& budget,
                                        ImageUse use = ImageUse::kPixels,
                                        const CancelToken* cancel = nullptr);

// True if this program has a decoder for the format. `head`: the first bytes of the image, at least
// kImageHeadBytes unless the image is shorter.
inline constexpr size_t kImageHeadBytes = 64;
bool is_readable_format(std::span<const std::byte> head);

// Returns the formats that this program reads: "PNG, JPEG or WebP".
std::string readable_image_formats();

}  // namespace voxdag
