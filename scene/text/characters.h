// Kinds of characters in text files. They do not depend on the locale.
#pragma once

#include <string_view>

namespace voxdag {

constexpr bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }
constexpr bool is_line_end(char c) { return c == '\n' || c == '\r'; }

// Ctrl-Z, with which old editors mark the end of a text. NUL bytes may follow it, or replace it.
constexpr char kEndMark = '\x1a';
constexpr bool is_end_mark(char c) { return c == kEndMark || c == '\0'; }

// Returns the text without end marks at its end.
constexpr std::string_view without_end_marks(std::string_view text) {
  while (!text.empty() && is_end_mark(text.back())) text.remove_suffix(1);
  return text;
}

// Returns the text without blanks at both ends.
constexpr std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

// Removes the first word and the blanks before it from the text. Returns this word; empty if the
// text has only blanks.
constexpr std::string_view next_word(std::string_view& text) {
  size_t begin = 0;
  while (begin < text.size() && is_blank(text[begin])) ++begin;
  size_t end = begin;
  while (end < text.size() && !is_blank(text[end])) ++end;
  const std::string_view word = text.substr(begin, end - begin);
  text.remove_prefix(end);
  return word;
}

constexpr char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; }

// True if the texts are equal, apart from the case of ASCII letters.
constexpr bool equals_in_any_case(std::string_view a, std::string_view b) {
  if (a.size() != b.size()) return false;
  for (size_t i = 0; i < a.size(); ++i)
    if (lower(a[i]) != lower(b[i])) return false;
  return true;
}

}  // namespace voxdag
