// Recognizes image formats by their first bytes.
#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace voxdag {

enum class ImageDecoder { kNone, kPng, kJpeg, kWebp, kAvif };

struct ImageFormat {
  const char* name;                            // such as "a GIF image"
  const char* remedy = "";                     // instruction for users to get a readable image
  ImageDecoder decoder = ImageDecoder::kNone;  // the format's decoder, if the program has it
  bool is_image = true;
};

// Returns the format of a file with these first bytes; null if it is unknown. Also recognizes files
// that are often found in place of an image, such as a web page from a failed download.
const ImageFormat* image_format_of(std::span<const std::byte> head);

}  // namespace voxdag
