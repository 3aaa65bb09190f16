#include "tests/support/modern_image_files.h"

#ifdef VOXDAG_HAS_WEBP
#include <webp/encode.h>
#endif
#ifdef VOXDAG_HAS_AVIF
#include <avif/avif.h>
#endif

#include <algorithm>
#include <stdexcept>
#include <vector>

namespace voxdag::test {
namespace {

[[maybe_unused]] void require(bool condition) {
  if (!condition) throw std::runtime_error("an image cannot be encoded");
}

[[maybe_unused]] std::string little_endian(uint64_t value, int bytes) {
  std::string text;
  for (int i = 0; i < bytes; ++i) text += static_cast<char>(value >> 8 * i);
  return text;
}

}  // namespace

#ifdef VOXDAG_HAS_WEBP
std::string webp_file(uint32_t width, uint32_t height, const std::string& pixels,
                      bool is_lossless) {
  WebPConfig config;
  WebPPicture picture;
  WebPMemoryWriter writer;
  require(WebPConfigInit(&config) && WebPPictureInit(&picture));
  WebPMemoryWriterInit(&writer);
  config.lossless = config.exact = is_lossless;
  config.quality = 95;
  config.method = 6;
  picture.use_argb = 1;
  picture.width = static_cast<int>(width);
  picture.height = static_cast<int>(height);
  picture.writer = WebPMemoryWrite;
  picture.custom_ptr = &writer;
  require(WebPPictureImportRGBA(&picture, reinterpret_cast<const uint8_t*>(pixels.data()),
                                4 * picture.width));
  require(WebPEncode(&config, &picture));
  std::string file(reinterpret_cast<const char*>(writer.mem), writer.size);
  WebPPictureFree(&picture);
  WebPMemoryWriterClear(&writer);
  return file;
}

std::string animated_webp_file(uint32_t width, uint32_t height, const std::string& pixels) {
  const std::string still = webp_file(width, height, pixels).substr(12);
  const std::string size = little_endian(width - 1, 3) + little_endian(height - 1, 3);
  const auto chunk = [](const std::string& name, const std::string& content) {
    return name + little_endian(static_cast<uint32_t>(content.size()), 4) + content;
  };
  const std::string frame = little_endian(0, 6) + size + little_endian(100, 3) + '\0' + still;
  const std::string chunks = chunk("VP8X", little_endian(0x12, 4) + size) +
                             chunk("ANIM", little_endian(0, 6)) + chunk("ANMF", frame);
  return "RIFF" + little_endian(static_cast<uint32_t>(chunks.size()) + 4, 4) + "WEBP" + chunks;
}
#endif

#ifdef VOXDAG_HAS_AVIF
namespace {

avifPixelFormat pixel_format(int chroma) {
  return chroma == 444   ? AVIF_PIXEL_FORMAT_YUV444
         : chroma == 422 ? AVIF_PIXEL_FORMAT_YUV422
         : chroma == 420 ? AVIF_PIXEL_FORMAT_YUV420
                         : AVIF_PIXEL_FORMAT_YUV400;
}

// Returns the planes of the columns [first, first + width) of the pixels.
avifImage* make_planes(const AvifFormat& format, const std::string& pixels, uint32_t first,
                       uint32_t width) {
  avifImage* const image = avifImageCreate(static_cast<int>(width), static_cast<int>(format.height),
                                           format.bits, pixel_format(format.chroma));
  require(image);
  image->matrixCoefficients = static_cast<avifMatrixCoefficients>(format.matrix);
  image->yuvRange = format.is_limited ? AVIF_RANGE_LIMITED : AVIF_RANGE_FULL;
  avifRGBImage rgb;
  avifRGBImageSetDefaults(&rgb, image);
  rgb.depth = 8;
  rgb.ignoreAlpha = !format.has_alpha;
  std::string copy = pixels;
  rgb.pixels = reinterpret_cast<uint8_t*>(copy.data()) + size_t{4} * first;
  rgb.rowBytes = 4 * format.width;
  require(avifImageRGBToYUV(image, &rgb) == AVIF_RESULT_OK);
  return image;
}

}  // namespace

std::string avif_file(const AvifFormat& format, const std::string& pixels) {
  const auto columns = static_cast<uint32_t>(format.tile_columns);
  std::vector<avifImage*> tiles;
  for (uint32_t i = 0; i < columns; ++i)
    tiles.push_back(
        make_planes(format, pixels, i * (format.width / columns), format.width / columns));
  avifEncoder* const encoder = avifEncoderCreate();
  require(encoder);
  encoder->speed = 10;
  encoder->minQuantizer = encoder->maxQuantizer = AVIF_QUANTIZER_LOSSLESS;
  encoder->minQuantizerAlpha = encoder->maxQuantizerAlpha = AVIF_QUANTIZER_LOSSLESS;
#if AVIF_VERSION >= 1000000
  encoder->quality = encoder->qualityAlpha = AVIF_QUALITY_LOSSLESS;
#endif
  require(avifEncoderAddImageGrid(encoder, columns, 1, const_cast<const avifImage**>(tiles.data()),
                                  AVIF_ADD_IMAGE_FLAG_SINGLE) == AVIF_RESULT_OK);
  avifRWData output = AVIF_DATA_EMPTY;
  require(avifEncoderFinish(encoder, &output) == AVIF_RESULT_OK);
  std::string file(reinterpret_cast<const char*>(output.data), output.size);
  avifRWDataFree(&output);
  avifEncoderDestroy(encoder);
  std::ranges::for_each(tiles, avifImageDestroy);
  return file;
}

std::string pixels_by_libavif(const std::string& file) {
  avifDecoder* const decoder = avifDecoderCreate();
  avifImage* const image = avifImageCreateEmpty();
  require(avifDecoderReadMemory(decoder, image, reinterpret_cast<const uint8_t*>(file.data()),
                                file.size()) == AVIF_RESULT_OK);
  avifRGBImage rgb;
  avifRGBImageSetDefaults(&rgb, image);
  rgb.depth = 8;
  rgb.avoidLibYUV = AVIF_TRUE;
  rgb.chromaUpsampling = AVIF_CHROMA_UPSAMPLING_BILINEAR;
  std::string pixels(size_t{4} * image->width * image->height, '\0');
  rgb.pixels = reinterpret_cast<uint8_t*>(pixels.data());
  rgb.rowBytes = 4 * image->width;
  require(avifImageYUVToRGB(image, &rgb) == AVIF_RESULT_OK);
  avifImageDestroy(image);
  avifDecoderDestroy(decoder);
  return pixels;
}
#endif

}  // namespace voxdag::test
