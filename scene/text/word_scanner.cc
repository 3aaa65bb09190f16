#include "scene/text/word_scanner.h"

#include <algorithm>
#include <cstddef>

#include "scene/text/characters.h"

namespace voxdag {
namespace {

// Maximum length of a word in bytes. No program writes longer numbers. A longer word is returned in
// pieces, so the row has too many words and is refused.
constexpr size_t kMaxWord = 64;

// Maximum number of end marks (characters.h) at the end of a text.
constexpr size_t kMaxMarks = 4096;

}  // namespace

void WordScanner::begin_row(uint64_t offset) {
  offset_ = offset;
  skip_blanks();
  while (is_line_end(peek())) {
    ++offset_;
    skip_blanks();
  }
}

std::string_view WordScanner::word() {
  skip_blanks();
  const std::string_view text = text_at(offset_);
  size_t size = 0;
  while (size < text.size() && !is_blank(text[size]) && !is_line_end(text[size])) ++size;
  if (size > 0 && is_end_mark(text[size - 1])) return word_before_marks(text.substr(0, size));
  offset_ += size;
  return text.substr(0, size);
}

// Returns `word`, which is at offset_ and ends with end marks, and moves past it. At the end of the
// file, returns it without the end marks.
std::string_view WordScanner::word_before_marks(std::string_view word) {
  const uint64_t begin = offset_;
  size_t size = word.size();
  offset_ += without_end_marks(word).size();
  if (is_at_end())
    size = static_cast<size_t>(offset_ - begin);
  else
    offset_ = begin + size;
  return text_at(begin).substr(0, size);
}

bool WordScanner::end_row() {
  skip_blanks();
  const char c = peek();
  if (c != '\0' && !is_line_end(c)) return false;
  if (offset_ < window_.file().size()) ++offset_;
  return true;
}

// Returns the next character without moving past it; 0 at the end of the file. A byte with the
// value 0 is neither a blank nor a digit, so it is refused as a word.
char WordScanner::peek() {
  const auto bytes = window_.at(offset_, 1);
  const char c = bytes.empty() ? '\0' : static_cast<char>(bytes[0]);
  return c == kEndMark && is_at_end() ? '\0' : c;
}

std::string_view WordScanner::text_at(uint64_t offset) {
  const auto bytes = window_.at(offset, kMaxWord);
  return {reinterpret_cast<const char*>(bytes.data()), std::min(bytes.size(), kMaxWord)};
}

// True if only end marks (characters.h) follow, or nothing.
bool WordScanner::is_at_end() {
  const auto bytes = window_.at(offset_, kMaxMarks);
  return offset_ + bytes.size() >= window_.file().size() &&
         std::ranges::all_of(bytes, [](std::byte b) { return is_end_mark(static_cast<char>(b)); });
}

void WordScanner::skip_blanks() {
  while (is_blank(peek())) ++offset_;
}

}  // namespace voxdag
