// Parses a list of numbers that an option takes as one text, such as X,Y,Z or WIDTHxHEIGHT.
#pragma once

#include <array>
#include <charconv>
#include <string>

#include "core/base/error.h"

namespace voxdag::cli {

// Exactly kCount numbers separated by `separator`. Throws Error{kInvalidInput} that names the
// option and says what was `expected`.
template <class Number, size_t kCount>
std::array<Number, kCount> parse_list(const std::string& option, const std::string& text,
                                      char separator, const std::string& expected) {
  std::array<Number, kCount> numbers{};
  const char* at = text.data();
  const char* const end = at + text.size();
  for (size_t i = 0; i < kCount; ++i) {
    const auto [stop, error] = std::from_chars(at, end, numbers[i]);
    const bool last = i + 1 == kCount;
    if (error != std::errc() || (last ? stop != end : stop == end || *stop != separator))
      throw Error(ErrorCode::kInvalidInput, option + " '" + text + "': expected " + expected);
    at = stop + (last ? 0 : 1);
  }
  return numbers;
}

}  // namespace voxdag::cli
