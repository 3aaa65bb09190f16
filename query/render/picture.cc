#include "query/render/picture.h"

#include <png.h>

#include "core/base/error.h"

namespace voxdag::query {

std::string encode_png(const Picture& picture) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<uint32_t>(picture.width);
  image.height = static_cast<uint32_t>(picture.height);
  image.format = PNG_FORMAT_RGB;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::string png(size, '\0');
  if (!png_image_write_to_memory(&image, png.data(), &size, 0, picture.rgb.data(), 0, nullptr))
    throw Error(ErrorCode::kOutOfMemory, std::string("writing PNG: ") + image.message);
  png.resize(size);
  return png;
}

}  // namespace voxdag::query
