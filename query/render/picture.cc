#include "query/render/picture.h"

#include <algorithm>
#include <cctype>
#include <span>
#include <string_view>

#include "core/base/error.h"
#include "core/image/jpeg_writer.h"
#include "core/image/png_writer.h"

namespace voxdag::query {
namespace {

// The length of a PNG's signature and IHDR chunk, in bytes. The chunk kSoftware follows them.
constexpr size_t kHeadBytes = 33;
// The tEXt chunk that names voxdag as the software: its length, type, keyword and text, and CRC.
constexpr std::string_view kSoftware{"\0\0\0\x0ftEXtSoftware\0voxdag\x59\x60\x14\x49", 27};
// The comment segment that names voxdag as the software of a JPEG file, and the segment's offset in
// the file.
constexpr std::string_view kComment = "voxdag";
constexpr std::string_view kCommentMarker{"\xff\xfe\0\x08voxdag", 10};
constexpr size_t kCommentAt = 20;

bool has_at(const ReadableFile& file, uint64_t offset, std::string_view expected) {
  if (file.size() < offset + expected.size()) return false;
  std::string bytes(expected.size(), '\0');
  file.read_at(offset, std::as_writable_bytes(std::span(bytes)));
  return bytes == expected;
}

bool has_ending(std::string_view name, std::string_view ending) {
  return name.size() >= ending.size() &&
         std::ranges::equal(name.substr(name.size() - ending.size()), ending,
                            [](unsigned char a, char b) { return std::tolower(a) == b; });
}

}  // namespace

std::string encode_png(const Picture& picture) {
  std::string png = voxdag::encode_png(static_cast<uint32_t>(picture.width),
                                       static_cast<uint32_t>(picture.height), picture.bytes);
  return png.insert(kHeadBytes, kSoftware);
}

bool is_jpeg_name(std::string_view path) {
  return has_ending(path, ".jpg") || has_ending(path, ".jpeg");
}

std::string encode_picture(const Picture& picture, std::string_view path) {
  if (!is_jpeg_name(path)) return encode_png(picture);
  if (picture.channels != 3)
    throw Error(ErrorCode::kInvalidInput,
                std::string(path) +
                    ": a JPEG file cannot be transparent: expected a name that ends in .png");
  return encode_jpeg(static_cast<uint32_t>(picture.width), static_cast<uint32_t>(picture.height),
                     picture.bytes, kComment);
}

bool is_rendered_picture(const ReadableFile& file) {
  return has_at(file, kHeadBytes, kSoftware) || has_at(file, kCommentAt, kCommentMarker);
}

}  // namespace voxdag::query
