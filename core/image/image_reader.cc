#include "core/image/image_reader.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/image/image_formats.h"
#include "core/image/readers.h"

namespace voxdag {

void ImageReader::check_size(uint64_t width, uint64_t height) {
  if (width > kMaxEdge || height > kMaxEdge || width * height > kMaxPixels)
    throw BrokenImage{"has " + std::to_string(width) + " x " + std::to_string(height) +
                      " pixels, the limits are " + std::to_string(kMaxEdge) +
                      " along an edge and 2^28 in total"};
  if (width == 0 || height == 0)
    throw BrokenImage{"has " + std::to_string(width) + " x " + std::to_string(height) +
                      " pixels, expected at least one"};
  width_ = static_cast<uint32_t>(width);
  height_ = static_cast<uint32_t>(height);
}

namespace {

// Decoders in this program.
constexpr ImageDecoder kDecoders[] = {
    ImageDecoder::kNone,
#ifdef VOXDAG_HAS_IMAGES
    ImageDecoder::kPng,  ImageDecoder::kJpeg,
#endif
#ifdef VOXDAG_HAS_WEBP
    ImageDecoder::kWebp,
#endif
#ifdef VOXDAG_HAS_AVIF
    ImageDecoder::kAvif,
#endif
};

bool has_decoder(ImageDecoder decoder) {
  return decoder != ImageDecoder::kNone && std::ranges::count(kDecoders, decoder) > 0;
}

[[noreturn]] void refuse(const ImageFormat* format, bool is_empty) {
  const std::string expected = ", expected " + readable_image_formats();
  if (is_empty) throw BrokenImage{"is empty" + expected};
  if (!format) throw BrokenImage{"has an unknown format" + expected};
  std::string message = std::string("is ") + format->name;
  if (format->decoder != ImageDecoder::kNone) message += ", whose decoder this voxdag lacks";
  message += expected;
  if (*format->remedy) message += std::string(" (") + format->remedy + ")";
  throw BrokenImage{message};
}

}  // namespace

bool is_readable_format(std::span<const std::byte> head) {
  const ImageFormat* const format = image_format_of(head);
  return format && has_decoder(format->decoder);
}

std::string readable_image_formats() {
  constexpr std::pair<ImageDecoder, const char*> kNames[] = {{ImageDecoder::kPng, "PNG"},
                                                             {ImageDecoder::kJpeg, "JPEG"},
                                                             {ImageDecoder::kWebp, "WebP"},
                                                             {ImageDecoder::kAvif, "AVIF"}};
  std::vector<std::string> names;
  for (const auto& [decoder, name] : kNames)
    if (has_decoder(decoder)) names.push_back(name);
  if (names.empty()) return "no image, because this voxdag was built with VOXDAG_IMAGES=OFF";
  std::string list = names[0];
  for (size_t i = 1; i < names.size(); ++i)
    list += (i + 1 == names.size() ? " or " : ", ") + names[i];
  return list;
}

std::unique_ptr<ImageReader> open_image(EncodedBytes& bytes, [[maybe_unused]] MemoryBudget& budget,
                                        [[maybe_unused]] ImageUse use, const CancelToken* cancel) {
  auto source = std::make_unique<PeekedSource>(bytes, cancel);
  const ImageFormat* const format = image_format_of(source->head());
  switch (format ? format->decoder : ImageDecoder::kNone) {
#ifdef VOXDAG_HAS_IMAGES
    case ImageDecoder::kPng:
      return open_png(std::move(source), budget, use);
    case ImageDecoder::kJpeg:
      return open_jpeg(std::move(source), budget, use);
#endif
#ifdef VOXDAG_HAS_WEBP
    case ImageDecoder::kWebp:
      return open_webp(std::move(source), budget);
#endif
#ifdef VOXDAG_HAS_AVIF
    case ImageDecoder::kAvif:
      return open_avif(std::move(source), budget);
#endif
    default:
      refuse(format, source->head().empty());
  }
}

}  // namespace voxdag
