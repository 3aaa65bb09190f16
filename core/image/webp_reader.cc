// Reads WebP images with libwebp, which decodes an image in one piece. Its decoding is exact, so
// all versions and instruction sets give the same pixels.
#include <webp/decode.h>

#include <cstring>
#include <string_view>
#include <utility>

#include "core/base/error.h"
#include "core/base/page_buffer.h"
#include "core/image/readers.h"
#include "core/image/webp_tables.h"

namespace voxdag {
namespace {

constexpr uint64_t kWebpStateBytes = uint64_t{1} << 20;

uint32_t little_endian(std::span<const uint8_t> bytes) {
  uint32_t value = 0;
  for (size_t i = 0; i < 4; ++i) value |= uint32_t{bytes[i]} << 8 * i;
  return value;
}

// Calls visit(name, contents) for each chunk of the file.
template <class Visit>
void visit_chunks(std::span<const uint8_t> file, const Visit& visit) {
  constexpr size_t kRiffHeader = 12, kChunkHeader = 8;
  if (file.size() < kRiffHeader) return;
  file = file.subspan(kRiffHeader);
  while (file.size() >= kChunkHeader) {
    const std::string_view name(reinterpret_cast<const char*>(file.data()), 4);
    const size_t size = little_endian(file.subspan(4));
    file = file.subspan(kChunkHeader);
    visit(name, file.first(std::min(size, file.size())));
    file = file.subspan(std::min(size + size % 2, file.size()));
  }
}

class WebpReader : public ImageReader {
 public:
  WebpReader(std::unique_ptr<PeekedSource> source, MemoryBudget& budget)
      : source_(std::move(source)), budget_(budget), file_(*source_, budget) {
    WebPBitstreamFeatures features;
    check(WebPGetFeatures(file_.bytes().data(), file_.bytes().size(), &features));
    if (features.has_animation)
      throw BrokenImage{"is an animated WebP image, expected a still image"};
    check_size(static_cast<uint64_t>(features.width), static_cast<uint64_t>(features.height));
  }

  void read_row(std::span<std::byte> row) override {
    if (pixels_.size() == 0) decode();
    std::memcpy(row.data(), &pixels_[next_row_++ * row.size()], row.size());
  }

 private:
  void decode() {
    source_->check_canceled();
    const uint64_t bytes = decoder_bytes(), row = uint64_t{4} * width_;
    if (bytes + row * height_ > kMaxDecoderBytes)
      throw BrokenImage{"is a WebP image that takes " +
                        std::to_string((bytes + row * height_) >> 20) +
                        " MiB to decode, the limit is 2048 MiB"};
    const MemoryCharge charge(budget_, bytes, "decoding a WebP image");
    pixels_ = PageBuffer<std::byte>(budget_, static_cast<size_t>(row * height_), "a WebP image");
    WebPDecoderConfig config;
    if (!WebPInitDecoderConfig(&config))
      throw BrokenImage{
          "cannot be decoded: expected the version of libwebp that voxdag was built with"};
    config.output.colorspace = MODE_RGBA;
    config.output.is_external_memory = 1;
    config.output.u.RGBA = {reinterpret_cast<uint8_t*>(pixels_.data()), static_cast<int>(row),
                            pixels_.size()};
    check(WebPDecode(file_.bytes().data(), file_.bytes().size(), &config));
  }

  // Returns an upper bound of the memory that libwebp allocates. This memory is for rows of blocks.
  // For lossless images and alpha, it is also for all pixels, the images of the transforms, and
  // decoding tables.
  uint64_t decoder_bytes() const {
    const uint64_t pixels = uint64_t{width_} * height_;
    uint64_t bytes = kWebpStateBytes + uint64_t{256} * width_;
    visit_chunks(file_.bytes(), [&](std::string_view name, std::span<const uint8_t> content) {
      constexpr size_t kLosslessHeader = 5, kAlphaHeader = 1;
      if (name == "ALPH") {
        bytes += pixels;
        const bool is_lossless = !content.empty() && (content[0] & 3) == 1;
        if (is_lossless) bytes += lossless_bytes(content.subspan(kAlphaHeader));
      } else if (name == "VP8L" && content.size() >= kLosslessHeader) {
        bytes += lossless_bytes(content.subspan(kLosslessHeader));
      }
    });
    return bytes;
  }
  uint64_t lossless_bytes(std::span<const uint8_t> stream) const {
    const auto tables = webp_table_bytes(stream, width_, height_);
    if (!tables) throw BrokenImage{"is a broken WebP image (its lossless data are damaged)"};
    // Bytes per pixel: four for the pixel, at most one for the images of the transforms, and one
    // for the image that selects tables.
    return uint64_t{6} * width_ * height_ + *tables;
  }

  static void check(VP8StatusCode status) {
    if (status == VP8_STATUS_OK) return;
    if (status == VP8_STATUS_OUT_OF_MEMORY)
      throw Error(ErrorCode::kOutOfMemory,
                  "out of memory: the system has none left for a WebP image: expected more free "
                  "memory on this machine");
    const bool is_short = status == VP8_STATUS_NOT_ENOUGH_DATA || status == VP8_STATUS_SUSPENDED;
    throw BrokenImage{std::string("is a broken WebP image (") +
                      (is_short ? "it ends early" : "its data are damaged") + ")"};
  }

  const std::unique_ptr<PeekedSource> source_;
  MemoryBudget& budget_;
  const WholeFile file_;
  PageBuffer<std::byte> pixels_;
  size_t next_row_ = 0;
};

}  // namespace

std::unique_ptr<ImageReader> open_webp(std::unique_ptr<PeekedSource> source, MemoryBudget& budget) {
  return std::make_unique<WebpReader>(std::move(source), budget);
}

}  // namespace voxdag
