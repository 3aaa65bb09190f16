// Recognizes image formats by their first bytes.
#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace voxdag {

enum class ImageDecoder { kNone, kPng, kJpeg, kWebp, kAvif };

struct ImageFormat {
  const char* name;                            // "a GIF image"
  const char* remedy = "";                     // how a user gets a readable image
  ImageDecoder decoder = ImageDecoder::kNone;  // the format's decoder; this program may lack it
  bool is_image = true;
};

// Returns the format of a file with these first bytes; null if it is unknown. Includes formats that
// often replace an image, such as a web page.
const ImageFormat* image_format_of(std::span<const std::byte> head);

}  // namespace voxdag
