#include "scene/text/word_scanner.h"

#include "scene/text/characters.h"

namespace voxdag {
namespace {

// Maximum length of a word in bytes. No program writes longer numbers. A longer word is returned in
// pieces, so the row has too many words and is refused.
constexpr size_t kMaxWord = 64;

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
  const auto bytes = window_.at(offset_, kMaxWord);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()),
                              std::min(bytes.size(), kMaxWord));
  size_t size = 0;
  while (size < text.size() && !is_blank(text[size]) && !is_line_end(text[size])) ++size;
  offset_ += size;
  return text.substr(0, size);
}

bool WordScanner::end_row() {
  skip_blanks();
  const char c = peek();
  if (c != '\0' && !is_line_end(c)) return false;
  if (offset_ < window_.file().size()) ++offset_;
  return true;
}

// Returns 0 at the end of the file. A byte with the value 0 is neither a blank nor a digit, so it
// is refused as a word.
char WordScanner::peek() {
  const auto bytes = window_.at(offset_, 1);
  return bytes.empty() ? '\0' : static_cast<char>(bytes[0]);
}

void WordScanner::skip_blanks() {
  while (is_blank(peek())) ++offset_;
}

}  // namespace voxdag
