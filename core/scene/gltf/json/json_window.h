// The JSON of a scene file, read through a small window, one character at a time.
//
// Strings can be long: a data: URI, of geometry or of an image, may be most of the file. The plain
// characters of a string past the first few thousand are withheld from the parser, which would
// collect them in memory. The place of the string in the file is recorded instead, so that a buffer
// can be decoded from there by windows. The characters that the parser sees are charged to the
// budget. Not thread-safe.
#pragma once

#include <cstddef>
#include <iterator>
#include <vector>

#include "core/base/cancel_token.h"
#include "core/io/file_system.h"
#include "core/scene/gltf/growing_charge.h"
#include "core/scene/gltf/json/file_range.h"

namespace voxdag::gltf {

class JsonWindow {
 public:
  // Both references must outlive the window.
  JsonWindow(const ReadableFile& file, FileRange json, MemoryBudget& budget,
             const CancelToken& cancel);

  bool at_end() const { return ended_; }
  char current() const { return current_; }
  void advance();

  // The string that ended last.
  const RawString& last_string() const { return string_; }

 private:
  bool next(char& c);
  void track(char c);
  void track_in_string(char c);
  bool is_withheld();

  const ReadableFile& file_;
  const FileRange json_;
  const CancelToken& cancel_;
  GrowingCharge charge_;
  std::vector<char> window_;
  uint64_t window_begin_ = 0;  // position in the file of window_[0]
  uint64_t position_ = 0;      // of the character after current_
  char current_ = 0;
  bool ended_ = false;

  bool in_string_ = false;
  bool after_backslash_ = false;
  int hex_digits_left_ = 0;  // of an escape \uXXXX
  bool in_escape_ = false;   // current_ is part of an escape
  uint64_t shown_ = 0;       // characters of the string that were not withheld
  RawString string_;
};

// An input iterator over a JsonWindow for the parser.
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
  // Equal when both are at the end, the only comparison that the parser makes.
  bool operator==(const JsonIterator& other) const { return at_end() == other.at_end(); }
  bool operator!=(const JsonIterator& other) const { return !(*this == other); }

 private:
  bool at_end() const { return !window_ || window_->at_end(); }

  JsonWindow* window_ = nullptr;
};

}  // namespace voxdag::gltf
