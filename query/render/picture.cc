#include "query/render/picture.h"

#include <png.h>

#include <span>
#include <string_view>

#include "core/base/error.h"

namespace voxdag::query {
namespace {

// The length of a PNG's signature and IHDR chunk.
constexpr size_t kHeadBytes = 33;
// A tEXt chunk: length, type, keyword and text, CRC.
constexpr std::string_view kSoftware{"\0\0\0\x0ftEXtSoftware\0voxdag\x59\x60\x14\x49", 27};

}  // namespace

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
  return png.insert(kHeadBytes, kSoftware);
}

bool is_rendered_png(const ReadableFile& file) {
  if (file.size() < kHeadBytes + kSoftware.size()) return false;
  std::string chunk(kSoftware.size(), '\0');
  file.read_at(kHeadBytes, std::as_writable_bytes(std::span(chunk)));
  return chunk == kSoftware;
}

}  // namespace voxdag::query
