// The JSON of a scene file, read through a small window, one character at a time.
//
// A data: URI may be as long as the file, be it geometry or a picture. Its base64 characters past
// the first few are withheld from the parser, which would gather them in memory; where the string
// lies in the file is remembered instead, so that a buffer can be decoded from there by windows.
#pragma once

#include <cstddef>
#include <iterator>
#include <memory>
#include <vector>

#include "core/io/file_system.h"
#include "core/scene/gltf/document.h"

namespace voxdag::gltf {

class JsonWindow {
 public:
  // `withhold` false hands out every character.
  JsonWindow(const ReadableFile& file, FileRange json, bool withhold);

  bool at_end() const { return ended_; }
  char current() const { return current_; }
  void advance();

  // The string that ended last: its raw characters between the quotes, and whether there is a JSON
  // escape among them.
  FileRange last_string() const { return string_; }
  bool last_string_escaped() const { return escaped_; }

 private:
  bool next(char& c);
  void track(char c);
  void track_in_string(char c);
  bool is_withheld() const;

  const ReadableFile& file_;
  const FileRange json_;
  const bool withhold_;
  std::vector<char> window_;
  uint64_t window_begin_ = 0;  // position in the file of window_[0]
  uint64_t position_ = 0;      // of the character after current_
  char current_ = 0;
  bool ended_ = false;
  // Inside a string:
  bool in_string_ = false;
  bool after_backslash_ = false;
  int hex_digits_left_ = 0;  // of a \uXXXX
  bool in_escape_ = false;   // current_ is part of an escape
  bool is_data_uri_ = false;
  bool escaped_ = false;
  FileRange string_;
};

// An input iterator over a JsonWindow, as parsers take it.
class JsonIterator {
 public:
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = char;

  JsonIterator() = default;
  explicit JsonIterator(JsonWindow& window) : window_(&window) {}
  char operator*() const { return window_->current(); }
  JsonIterator& operator++() {
    window_->advance();
    return *this;
  }
  JsonIterator operator++(int) { return ++*this; }
  // Equal when both are at the end, which is all that a parser asks.
  bool operator==(const JsonIterator& other) const { return at_end() == other.at_end(); }
  bool operator!=(const JsonIterator& other) const { return !(*this == other); }

 private:
  bool at_end() const { return !window_ || window_->at_end(); }

  JsonWindow* window_ = nullptr;
};

}  // namespace voxdag::gltf
