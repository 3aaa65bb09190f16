// Writes PLY files for tests.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <sstream>
#include <string>

namespace voxdag::test {

enum class PlyFormat { kAscii, kLittle, kBig };

// Builds a PLY file: header lines and rows of numbers. Each number is appended in the type of the
// argument, which must be the type in the header.
class PlyWriter {
 public:
  explicit PlyWriter(PlyFormat format, std::string line_end = "\n")
      : format_(format), line_end_(std::move(line_end)) {
    static const char* kNames[] = {"ascii", "binary_little_endian", "binary_big_endian"};
    header("ply");
    header(std::string("format ") + kNames[static_cast<int>(format)] + " 1.0");
  }

  PlyWriter& header(const std::string& line) {
    text_ += line + line_end_;
    return *this;
  }
  template <class T>
  PlyWriter& put(T value) {
    if (format_ == PlyFormat::kAscii) {
      std::ostringstream number;
      number.precision(17);
      number << +value;
      text_ += (at_line_begin_ ? "" : " ") + number.str();
      at_line_begin_ = false;
      return *this;
    }
    std::string bytes(sizeof(T), '\0');
    std::memcpy(bytes.data(), &value, sizeof(T));
    if (format_ == PlyFormat::kBig) std::reverse(bytes.begin(), bytes.end());
    text_ += bytes;
    return *this;
  }
  template <class T>
  PlyWriter& put_all(std::initializer_list<T> values) {
    for (T value : values) put(value);
    return *this;
  }
  PlyWriter& end_row() {
    if (format_ == PlyFormat::kAscii) text_ += line_end_;
    at_line_begin_ = true;
    return *this;
  }
  const std::string& text() const { return text_; }

 private:
  const PlyFormat format_;
  const std::string line_end_;
  std::string text_;
  bool at_line_begin_ = true;
};

constexpr PlyFormat kFormats[] = {PlyFormat::kAscii, PlyFormat::kLittle, PlyFormat::kBig};

}  // namespace voxdag::test
