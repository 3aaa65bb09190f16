#include "core/base/text/printable.h"

#include <algorithm>
#include <cstdint>
#include <cstdio>

#include "core/base/text/utf8.h"

namespace voxdag {
namespace {

struct CodeRange {
  char32_t first, last;
};
constexpr CodeRange kNotPrintable[] = {{0, 0x1f},
                                       {0x7f, 0x9f},
                                       {0x61c, 0x61c},
                                       {0x200e, 0x200f},
                                       {0x2028, 0x202e},
                                       {0x2066, 0x2069},
                                       {kNoCharacter, kNoCharacter}};

bool is_printable_code(char32_t code) {
  return std::ranges::none_of(kNotPrintable, [&](const CodeRange& range) {
    return code >= range.first && code <= range.last;
  });
}

// Returns the text with some characters replaced: for each character for which keeps(code) is
// false, calls replace(out, character), which appends the replacement to `out`.
template <class Keeps, class Replace>
std::string converted(std::string_view text, const Keeps& keeps, const Replace& replace) {
  std::string out;
  out.reserve(text.size());
  while (!text.empty()) {
    const Character character = first_character(text);
    if (keeps(character.code))
      out += text.substr(0, character.bytes);
    else
      replace(out, character);
    text.remove_prefix(character.bytes);
  }
  return out;
}

void put_mark(std::string& out, const Character&) { out += '?'; }

}  // namespace

size_t printable_bytes(std::string_view text) {
  const Character character = first_character(text);
  return is_printable_code(character.code) ? character.bytes : 0;
}

bool is_printable(std::string_view text) {
  for (size_t bytes; !text.empty(); text.remove_prefix(bytes))
    if ((bytes = printable_bytes(text)) == 0) return false;
  return true;
}

std::string printable_line(std::string_view text) {
  return converted(text, is_printable_code, put_mark);
}

std::string printable_lines(std::string_view text) {
  const auto keeps = [](char32_t code) {
    return code == '\n' || code == '\t' || is_printable_code(code);
  };
  return converted(text, keeps, put_mark);
}

std::string printable_json(std::string_view json) {
  // Keeps characters below U+0020. They are white space between the values of the JSON, because
  // within strings such characters are already escaped.
  const auto keeps = [](char32_t code) { return code < 0x20 || is_printable_code(code); };
  return converted(json, keeps, [](std::string& out, const Character& character) {
    char escape[16];
    const bool is_character = character.code != kNoCharacter;
    std::snprintf(escape, sizeof escape, "\\u%04x",
                  is_character ? static_cast<unsigned>(character.code) : 0xfffdu);
    out += escape;
  });
}

}  // namespace voxdag
