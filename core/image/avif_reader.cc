// Reads AVIF images with libavif, which decodes an image in one piece. yuv_rows.h converts the
// image's planes to RGB, because the results of libavif's own conversion differ between versions
// and machines.
#include <avif/avif.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "core/base/error.h"
#include "core/image/readers.h"
#include "core/image/yuv_rows.h"

namespace voxdag {
namespace {

constexpr uint64_t kAvifStateBytes = uint64_t{16} << 20;
// Bytes of memory per pixel. kBytesPerPixel is for channels of up to 8 bits, kBytesPerWidePixel for
// channels of more bits. Both include the decoder's planes, its state per block, and a second set
// of planes for images that consist of several tiles.
constexpr uint64_t kBytesPerPixel = 16, kBytesPerWidePixel = 28;
// The decoder gets a limit for the number of pixels: the number in the image, but at least
// kMinSizeLimit. A damaged file can make the decoder allocate memory for as many pixels as the
// limit allows.
constexpr uint32_t kMinSizeLimit = 1 << 16;

struct DestroyDecoder {
  void operator()(avifDecoder* decoder) const { avifDecoderDestroy(decoder); }
};
using Decoder = std::unique_ptr<avifDecoder, DestroyDecoder>;

class AvifReader : public ImageReader {
 public:
  AvifReader(std::unique_ptr<PeekedSource> source, MemoryBudget& budget)
      : source_(std::move(source)),
        budget_(budget),
        file_(*source_, budget),
        state_charge_(budget, kAvifStateBytes, "an AVIF image") {
    parse(static_cast<uint32_t>(kMaxPixels));
    const avifImage& image = *decoder_->image;
    if (decoder_->imageCount > 1)
      throw BrokenImage{"is an animated AVIF image, expected a still image"};
    check_size(image.width, image.height);
    bits_ = image.depth > 8 ? 16 : 8;
  }

  void read_row(std::span<std::byte> row) override {
    if (!rows_) decode();
    rows_->read(next_row_++, row);
  }

 private:
  void parse(uint32_t size_limit) {
    decoder_ = Decoder(avifDecoderCreate());
    if (!decoder_) fail(AVIF_RESULT_OUT_OF_MEMORY);
    // dav1d is the only decoder that obeys imageSizeLimit.
    if (avifCodecName(AVIF_CODEC_CHOICE_DAV1D, AVIF_CODEC_FLAG_CAN_DECODE))
      decoder_->codecChoice = AVIF_CODEC_CHOICE_DAV1D;
    decoder_->maxThreads = 1;
    decoder_->ignoreExif = decoder_->ignoreXMP = AVIF_TRUE;
    decoder_->strictFlags = AVIF_STRICT_DISABLED;
    decoder_->imageSizeLimit = size_limit;
    decoder_->imageDimensionLimit = kMaxEdge;
    decoder_->imageCountLimit = 1 << 16;
    const avifResult result =
        avifDecoderSetIOMemory(decoder_.get(), file_.bytes().data(), file_.bytes().size());
    if (result != AVIF_RESULT_OK) fail(result);
    if (const avifResult parsed = avifDecoderParse(decoder_.get()); parsed != AVIF_RESULT_OK)
      fail(parsed);
  }

  void decode() {
    source_->check_canceled();
    const uint64_t pixels = uint64_t{width_} * height_;
    const uint64_t limit = std::max<uint64_t>(pixels, kMinSizeLimit);
    const uint64_t bytes = limit * (bits_ == 16 ? kBytesPerWidePixel : kBytesPerPixel);
    if (bytes > kMaxDecoderBytes)
      throw BrokenImage{"is an AVIF image that takes " + std::to_string(bytes >> 20) +
                        " MiB to decode, the limit is 2048 MiB"};
    charge_ = MemoryCharge(budget_, bytes, "decoding an AVIF image");
    parse(static_cast<uint32_t>(limit));
    if (const avifResult result = avifDecoderNextImage(decoder_.get()); result != AVIF_RESULT_OK)
      fail(result);
    const avifImage& image = *decoder_->image;
    if (image.width != width_ || image.height != height_ || (image.depth > 8 ? 16 : 8) != bits_)
      throw BrokenImage{"is a broken AVIF image (its data have " + std::to_string(image.width) +
                        " x " + std::to_string(image.height) + " pixels of " +
                        std::to_string(image.depth) + " bits, its header declares " +
                        std::to_string(width_) + " x " + std::to_string(height_) + " pixels of " +
                        (bits_ == 8 ? "8" : "over 8") + " bits)"};
    rows_.emplace(planes_of(image));
  }

  static YuvPlanes planes_of(const avifImage& image) {
    YuvPlanes planes;
    planes.width = image.width;
    planes.height = image.height;
    planes.bits = static_cast<int>(image.depth);
    planes.is_limited = image.yuvRange == AVIF_RANGE_LIMITED;
    planes.is_premultiplied = image.alphaPremultiplied;
    planes.matrix = image.matrixCoefficients;
    planes.halves_width =
        image.yuvFormat == AVIF_PIXEL_FORMAT_YUV420 || image.yuvFormat == AVIF_PIXEL_FORMAT_YUV422;
    planes.halves_height = image.yuvFormat == AVIF_PIXEL_FORMAT_YUV420;
    const bool is_gray = image.yuvFormat == AVIF_PIXEL_FORMAT_YUV400;
    for (size_t i = 0; i < 3; ++i)
      if (i == 0 || !is_gray) planes.color[i] = {image.yuvPlanes[i], image.yuvRowBytes[i]};
    if (image.alphaPlane) planes.alpha = {image.alphaPlane, image.alphaRowBytes};
    return planes;
  }

  [[noreturn]] static void fail(avifResult result) {
    if (result == AVIF_RESULT_OUT_OF_MEMORY)
      throw Error(ErrorCode::kOutOfMemory,
                  "out of memory: the system has none left for an AVIF image: expected more free "
                  "memory on this machine");
    throw BrokenImage{std::string("is a broken AVIF image (") + avifResultToString(result) + ")"};
  }

  const std::unique_ptr<PeekedSource> source_;
  MemoryBudget& budget_;
  const WholeFile file_;
  const MemoryCharge state_charge_;
  MemoryCharge charge_;
  Decoder decoder_;
  std::optional<YuvRows> rows_;
  uint32_t next_row_ = 0;
};

}  // namespace

std::unique_ptr<ImageReader> open_avif(std::unique_ptr<PeekedSource> source, MemoryBudget& budget) {
  return std::make_unique<AvifReader>(std::move(source), budget);
}

}  // namespace voxdag
