#include "core/image/image_formats.h"

#include <algorithm>
#include <iterator>
#include <string_view>

#include "core/io/lfs_pointer.h"

namespace voxdag {
namespace {

// Remedies for error messages: commands that convert all images of a glTF scene, or a single image
// file, to a format that voxdag reads.
constexpr const char* kConvertScene =
    "convert the scene with: gltf-transform png IN.glb OUT.glb --formats '*'";
constexpr const char* kConvertImage = "convert it to PNG with: magick IN OUT.png";
constexpr const char* kConvertKtx =
    "convert the scene with: gltf-transform ktxdecompress IN.glb OUT.glb, or the image with: ktx "
    "extract IN.ktx2 OUT.png";

constexpr const char* kWebPage = "a web page, perhaps the error page of a failed download";

constexpr ImageFormat no_image(const char* name, const char* remedy) {
  return {name, remedy, ImageDecoder::kNone, false};
}

struct Signature {
  size_t offset;
  std::string_view bytes;
  ImageFormat format;
};

// If several signatures match, the first one counts. So more specific formats come first.
constexpr Signature kSignatures[] = {
    {0, "\x89PNG\r\n\x1a\n", {"a PNG image", "", ImageDecoder::kPng}},
    {0, "\xff\xd8\xff", {"a JPEG image", "", ImageDecoder::kJpeg}},
    {8, "WEBP", {"a WebP image", kConvertScene, ImageDecoder::kWebp}},
    {0, kLfsPointerBegin, no_image("a Git LFS pointer, not the image itself", "run git lfs pull")},
    {0, "\xabKTX 20", {"a KTX2 image", kConvertKtx}},
    {0, "\xabKTX 11", {"a KTX image", kConvertImage}},
    {0, "DDS ", {"a DDS image", kConvertImage}},
    {0, {"sB\x13\0", 4}, {"a Basis Universal image", "convert it to PNG with: basisu -unpack IN"}},
    {0, "GIF8", {"a GIF image", kConvertImage}},
    {0, {"II*\0", 4}, {"a TIFF image", kConvertImage}},
    {0, {"MM\0*", 4}, {"a TIFF image", kConvertImage}},
    {0, {"II+\0", 4}, {"a BigTIFF image", kConvertImage}},
    {0, "#?RADIANCE", {"a Radiance HDR image", kConvertImage}},
    {0, "#?RGBE", {"a Radiance HDR image", kConvertImage}},
    {0, "\x76\x2f\x31\x01", {"an OpenEXR image", kConvertImage}},
    {0, "8BPS", {"a Photoshop image", kConvertImage}},
    {0, {"\0\0\0\x0cjP  ", 8}, {"a JPEG 2000 image", kConvertImage}},
    {0, "\xff\x4f\xff\x51", {"a JPEG 2000 image", kConvertImage}},
    {0, {"\0\0\0\x0cJXL ", 8}, {"a JPEG XL image", kConvertImage}},
    {0, "\xff\x0a", {"a JPEG XL image", kConvertImage}},
    {0, "qoif", {"a QOI image", kConvertImage}},
    {0, "P4\n", {"a PBM image", kConvertImage}},
    {0, "P5\n", {"a PGM image", kConvertImage}},
    {0, "P6\n", {"a PPM image", kConvertImage}},
    {0, "PVR\x03", {"a PVR image", "convert it to PNG with PVRTexTool"}},
    {0, "\x13\xab\xa1\x5c", {"an ASTC image", "convert it to PNG with: astcenc -ds IN OUT.png"}},
    {0, "gimp xcf", {"a GIMP image", kConvertImage}},
    {0, {"\0\0\1\0", 4}, {"an icon file", kConvertImage}},
    {0, "<svg", {"an SVG drawing", kConvertImage}},
    {0, "<?xml", no_image("an XML file, perhaps an SVG drawing", kConvertImage)},
    {0, "<!DOCTYPE html", no_image(kWebPage, "")},
    {0, "<html", no_image(kWebPage, "")},
    {0, "\x1f\x8b", no_image("compressed by gzip", "unpack it first")},
    {0, "BM", {"a BMP image", kConvertImage}},
};

constexpr ImageFormat kAvif{"an AVIF image", kConvertScene, ImageDecoder::kAvif};
constexpr ImageFormat kHeif{"an HEIF image", kConvertImage};

// Returns the format of an image in a container of the ISO base media file format, such as AVIF or
// HEIC. The first box of the file lists brands, which identify the format.
const ImageFormat* format_of_brands(std::string_view head) {
  constexpr size_t kBrands = 8, kBrandBytes = 4;
  const auto has = [&](std::string_view brand) {
    for (size_t at = kBrands; at < head.size(); at += kBrandBytes)
      if (head.substr(at).starts_with(brand)) return true;
    return false;
  };
  if (has("avif") || has("avis")) return &kAvif;
  return has("heic") || has("heix") || has("mif1") ? &kHeif : nullptr;
}

}  // namespace

const ImageFormat* image_format_of(std::span<const std::byte> head) {
  const std::string_view text(reinterpret_cast<const char*>(head.data()), head.size());
  const auto found = std::ranges::find_if(kSignatures, [&](const Signature& s) {
    return text.size() > s.offset && text.substr(s.offset).starts_with(s.bytes);
  });
  if (found != std::end(kSignatures)) return &found->format;
  if (text.size() > 4 && text.substr(4).starts_with("ftyp")) return format_of_brands(text);
  return nullptr;
}

}  // namespace voxdag
