#include "query/render/picture.h"

#include <span>
#include <string_view>

#include "core/image/png_writer.h"

namespace voxdag::query {
namespace {

// The length of a PNG's signature and IHDR chunk, in bytes. The chunk kSoftware follows them.
constexpr size_t kHeadBytes = 33;
// The tEXt chunk that names voxdag as the software: its length, type, keyword and text, and CRC.
constexpr std::string_view kSoftware{"\0\0\0\x0ftEXtSoftware\0voxdag\x59\x60\x14\x49", 27};

}  // namespace

std::string encode_png(const Picture& picture) {
  std::string png = voxdag::encode_png(static_cast<uint32_t>(picture.width),
                                       static_cast<uint32_t>(picture.height), picture.rgb);
  return png.insert(kHeadBytes, kSoftware);
}

bool is_rendered_png(const ReadableFile& file) {
  if (file.size() < kHeadBytes + kSoftware.size()) return false;
  std::string chunk(kSoftware.size(), '\0');
  file.read_at(kHeadBytes, std::as_writable_bytes(std::span(chunk)));
  return chunk == kSoftware;
}

}  // namespace voxdag::query
