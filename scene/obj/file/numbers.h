// The numbers in the arguments of OBJ and MTL statements.
#pragma once

#include <charconv>
#include <cstddef>
#include <string_view>

#include "scene/text/characters.h"
#include "scene/text/numbers.h"

namespace voxdag::obj {

// Removes blanks at the beginning of the arguments. Returns true if a word follows, false at the
// end or before a comment.
inline bool has_word(std::string_view& arguments) {
  while (!arguments.empty() && is_blank(arguments.front())) arguments.remove_prefix(1);
  return !arguments.empty() && arguments.front() != '#';
}

// Removes the number at the beginning of the arguments, which must begin with a word. Returns false
// if the word is not a number.
inline bool next_number(std::string_view& arguments, double& out) {
  const char* const end = arguments.data() + arguments.size();
  const auto parsed = std::from_chars(arguments.data(), end, out);
  if (parsed.ec == std::errc() && (parsed.ptr == end || is_blank(*parsed.ptr))) {
    arguments.remove_prefix(static_cast<size_t>(parsed.ptr - arguments.data()));
    return true;
  }
  std::string_view rest = arguments;
  const auto value = parse_real<double>(next_word(rest));
  if (!value) return false;
  arguments = rest;
  out = *value;
  return true;
}

// Reads up to `max` numbers, and returns how many it has read. Stops at the end of the arguments,
// at a comment, or at a word that is not a number. `arguments` is then the rest.
inline size_t read_numbers(std::string_view& arguments, double* out, size_t max) {
  size_t count = 0;
  while (count < max && has_word(arguments) && next_number(arguments, out[count])) ++count;
  return count;
}

// Returns the number of words before a comment.
inline size_t count_words(std::string_view arguments) {
  size_t count = 0;
  bool in_word = false;
  for (const char c : arguments) {
    if (!in_word && c == '#') break;
    const bool blank = is_blank(c);
    count += !blank && !in_word;
    in_word = !blank;
  }
  return count;
}

}  // namespace voxdag::obj
