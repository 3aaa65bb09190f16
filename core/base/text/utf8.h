// Decodes text in UTF-8, character by character.
#pragma once

#include <cstddef>
#include <string_view>

namespace voxdag {

inline constexpr char32_t kNoCharacter = 0xffffffff;

struct Character {
  char32_t code;  // kNoCharacter: the first byte does not begin a character in UTF-8
  size_t bytes;   // 1 for kNoCharacter
};

// Decodes the character at the beginning of `text`, which is not empty. Like RFC 3629, refuses
// overlong forms and surrogates: a lax decoder could read a control character from them.
Character first_character(std::string_view text);

}  // namespace voxdag
