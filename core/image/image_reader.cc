#include "core/image/image_reader.h"

#include <string_view>
#include <utility>

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

std::unique_ptr<ImageReader> open_image(EncodedBytes& bytes, [[maybe_unused]] MemoryBudget& budget,
                                        [[maybe_unused]] ImageUse use) {
  auto source = std::make_unique<PeekedSource>(bytes);
  const std::string_view head(reinterpret_cast<const char*>(source->head().data()),
                              source->head().size());
#ifdef VOXDAG_HAS_IMAGES
  if (head.starts_with("\x89PNG\r\n\x1a\n")) return open_png(std::move(source), budget, use);
  if (head.starts_with("\xff\xd8\xff")) return open_jpeg(std::move(source), budget, use);
#else
  if (head.starts_with("\x89PNG") || head.starts_with("\xff\xd8\xff"))
    throw BrokenImage{"needs a decoder, and this voxdag was built with VOXDAG_IMAGES=OFF"};
#endif
  const char* const name = head.starts_with("RIFF")         ? "a WebP image"
                           : head.starts_with("\xabKTX 20") ? "a KTX2 image"
                           : head.empty()                   ? "empty"
                                                            : "of an unknown format";
  throw BrokenImage{std::string("is ") + name + ", expected PNG or JPEG"};
}

}  // namespace voxdag
