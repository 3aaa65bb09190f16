// The JSON of a scene file, read through a small window: a stream buffer that gives the parser
// single characters.
//
// Strings can be long: a data: URI of geometry or of an image may be most of the file. The parser
// would collect them in memory. So the window withholds the plain characters of a string past the
// first few thousand, and records the string's position in the file. The readers of buffers and
// images later decode the string from there, piece by piece. If several blanks are between two
// values, the parser receives one. NaN and infinities, which some programs write although JSON has
// no such numbers, reach the parser as null. A number with more digits than any value needs is
// refused. The memory for the characters that the parser collects is charged to the budget. Not
// thread-safe.
#pragma once

#include <cstddef>
#include <span>
#include <streambuf>
#include <string_view>
#include <vector>

#include "core/io/file_system.h"
#include "scene/gltf/json/file_range.h"
#include "scene/growing_charge.h"
#include "voxdag/cancel_token.h"

namespace voxdag::gltf {

class JsonWindow : public std::streambuf {
 public:
  // Both references must outlive the window.
  JsonWindow(const ReadableFile& file, FileRange json, MemoryBudget& budget,
             const CancelToken& cancel);

  // Returns the position in the file of the character that the parser receives next.
  uint64_t position() const { return position_; }
  // Returns the position of the last complete string in the file.
  const RawString& last_string() const { return string_; }

 private:
  static constexpr size_t kPeekCharacters = 32;  // enough for all spellings of NaN and infinity

  // Returns the next character for the parser.
  int_type uflow() override;
  bool next(char& c);
  void track(char c);
  void track_outside_strings(char c);
  void track_in_string(char c);
  bool is_withheld(char c);
  // Returns the length of a NaN or infinity whose first character was just read; 0 for other text.
  size_t non_finite_length() const;
  // Returns the next characters of the file, beginning with the last character that was read.
  // Copies them to `space` if they extend beyond the window.
  std::string_view peek(std::span<char, kPeekCharacters> space) const;

  const ReadableFile& file_;
  const FileRange json_;
  const CancelToken& cancel_;
  GrowingCharge charge_;
  std::vector<char> window_;
  uint64_t window_begin_ = 0;  // position in the file of window_[0]
  uint64_t position_ = 0;      // position of the next character

  bool in_string_ = false;
  bool after_backslash_ = false;
  int hex_digits_left_ = 0;       // remaining digits of an escape \uXXXX
  bool in_escape_ = false;        // the last character is part of an escape
  bool after_blank_ = false;      // the last character outside of strings is blank
  bool is_second_blank_ = false;  // the last two characters outside of strings are blank
  uint64_t word_ = 0;             // number of characters of the current number or literal
  std::string_view replacement_;  // characters that the parser receives next
  // Characters passed to the parser for the current string or number.
  uint64_t collected_ = 0;
  RawString string_;
};

}  // namespace voxdag::gltf
