#include "core/image/png_writer.h"

#include <png.h>

#include "core/base/error.h"

namespace voxdag {

std::string encode_png(uint32_t width, uint32_t height, std::span<const uint8_t> pixels) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = width;
  image.height = height;
  const bool has_alpha = pixels.size() == size_t{4} * width * height;
  image.format = has_alpha ? PNG_FORMAT_RGBA : PNG_FORMAT_RGB;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::string png(size, '\0');
  if (!png_image_write_to_memory(&image, png.data(), &size, 0, pixels.data(), 0, nullptr))
    throw Error(ErrorCode::kOutOfMemory, "out of memory: libpng cannot write an image of " +
                                             std::to_string(width) + " x " +
                                             std::to_string(height) + " pixels (" + image.message +
                                             "): expected a smaller image");
  png.resize(size);
  return png;
}

}  // namespace voxdag
