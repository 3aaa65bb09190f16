// Reads the bytes of an image in windows, from a scene file or from an image file.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/image/image_reader.h"
#include "core/io/file_system.h"
#include "scene/triangle_source.h"

namespace voxdag {

class ImageBytes : public EncodedBytes {
 public:
  // Throws Error{kInvalidInput} if the file has changed since the scene was opened.
  ImageBytes(FileSystem& files, const ImageSource& source);
  // Reads the next bytes of the image. Throws BrokenImage for a text that should be base64 but is
  // not.
  size_t read(std::span<std::byte> out) override;

 private:
  size_t read_plain(std::span<std::byte> out);
  bool next_character(char& c);
  bool next_base64_character(char& c);
  bool next_percent_decoded(char& c);
  bool next_group();
  bool next_base64_group();

  const std::unique_ptr<ReadableFile> file_;
  uint64_t at_, end_;               // the range of the file that is not read yet
  const bool is_text_, is_base64_;  // a text is percent-encoded if it is not base64
  uint64_t left_;                   // bytes of the image that read() has not returned yet
  std::vector<std::byte> window_;
  size_t window_at_ = 0;
  std::string pending_;  // characters that next_character() returns first
  bool has_ended_ = false;
  std::array<std::byte, 3> group_{};
  size_t group_at_ = 0, group_size_ = 0;
};

}  // namespace voxdag
