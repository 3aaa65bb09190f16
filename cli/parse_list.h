// Parses a list of numbers that an option takes as one text, such as X,Y,Z or WIDTHxHEIGHT.
#pragma once

#include <array>
#include <string>

#include "core/base/error.h"
#include "core/base/text.h"

namespace voxdag::cli {

// Exactly kCount numbers separated by `separator`. Throws Error{kInvalidInput} that names the
// option and says what was `expected`.
template <class Number, size_t kCount>
std::array<Number, kCount> parse_list(const std::string& option, const std::string& text,
                                      char separator, const std::string& expected) {
  const auto numbers = parse_numbers<Number, kCount>(text, separator);
  if (!numbers)
    throw Error(ErrorCode::kInvalidInput, option + " '" + text + "': expected " + expected);
  return *numbers;
}

}  // namespace voxdag::cli
