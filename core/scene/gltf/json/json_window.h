// The JSON of a scene file, read through a small window, one character at a time.
//
// Strings can be long: a data: URI, be it geometry or a picture, may be most of the file. Their
// plain characters past the first few thousand are withheld from the parser, which would gather
// them in memory; where the string lies in the file is remembered instead, so that a buffer can be
// decoded from there by windows. What the parser does gather is charged.
#pragma once

#include <cstddef>
#include <iterator>
#include <memory>
#include <vector>

#include "core/base/cancel_token.h"
#include "core/base/memory_budget.h"
#include "core/io/file_system.h"
#include "core/scene/gltf/document/document.h"

namespace voxdag::gltf {

class JsonWindow {
 public:
  // `cut_strings` false hands out every character.
  JsonWindow(const ReadableFile& file, FileRange json, bool cut_strings, MemoryBudget& budget,
             const CancelToken& cancel);

  bool at_end() const { return ended_; }
  char current() const { return current_; }
  void advance();

  // Of the string that ended last: its raw characters between the quotes, whether one of them is
  // an escape of JSON, and whether one was withheld.
  FileRange last_string() const { return string_; }
  bool last_string_is_escaped() const { return escaped_; }
  bool last_string_is_cut() const { return shown_ < string_.size; }

 private:
  bool next(char& c);
  void track(char c);
  void track_in_string(char c);
  bool is_withheld() const;
  void charge_shown();

  const ReadableFile& file_;
  const FileRange json_;
  const bool cut_strings_;
  const CancelToken& cancel_;
  MemoryCharge charge_;
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
  bool escaped_ = false;
  uint64_t shown_ = 0;  // characters that were not withheld
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
