#include "core/base/text/printable.h"

#include <algorithm>
#include <cstdint>
#include <cstdio>

namespace voxdag {
namespace {

constexpr char32_t kNoCharacter = 0xffffffff;

struct Character {
  char32_t code;  // kNoCharacter: the first byte does not begin a character in UTF-8
  size_t bytes;
};

// Decodes the character at the beginning of `text`. Like RFC 3629, refuses overlong forms and
// surrogates: a lax decoder could read a control character from them.
Character first_character(std::string_view text) {
  const auto byte = [&](size_t i) { return static_cast<unsigned char>(text[i]); };
  if (byte(0) < 0x80) return {byte(0), 1};
  const size_t bytes = byte(0) < 0xc2 ? 0 : byte(0) < 0xe0 ? 2 : byte(0) < 0xf0 ? 3 : 4;
  if (bytes == 0 || text.size() < bytes) return {kNoCharacter, 1};
  char32_t code = byte(0) & (0x7fu >> bytes);
  for (size_t i = 1; i < bytes; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return {kNoCharacter, 1};
    code = code << 6 | (byte(i) & 0x3f);
  }
  const bool overlong = (bytes == 3 && code < 0x800) || (bytes == 4 && code < 0x10000);
  const bool surrogate = code >= 0xd800 && code < 0xe000;
  if (overlong || surrogate || code > 0x10ffff) return {kNoCharacter, 1};
  return {code, bytes};
}

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
