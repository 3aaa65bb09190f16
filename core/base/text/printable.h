// Makes text from other sources safe to show: names, messages and paths that come from a scene, a
// request, a file name or another program. Such text could otherwise control a terminal, forge a
// line of a log, or show its characters in another order. Messages are converted where they leave
// the program. Pure functions.
//
// Not printable are
//   - control characters: U+0000 to U+001F, U+007F to U+009F;
//   - line separators: U+2028, U+2029;
//   - bidirectional controls: U+061C, U+200E, U+200F, U+202A to U+202E, U+2066 to U+2069;
//   - bytes that are not UTF-8.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace voxdag {

// Returns the number of bytes of the printable character at the beginning of `text`, which is not
// empty; 0 if the text does not begin with a printable character.
size_t printable_bytes(std::string_view text);

// True if all characters are printable.
bool is_printable(std::string_view text);

// Returns the text on one line. Each character that is not printable, including line feeds, and
// each byte that is not UTF-8 becomes a question mark.
std::string printable_line(std::string_view text);
// Like printable_line(), but keeps line feeds and tabs. For text that consists of lines, such as a
// log file.
std::string printable_lines(std::string_view text);

// Returns the JSON with escapes for the characters in its strings that are not printable. The value
// of the JSON remains the same.
std::string printable_json(std::string_view json);

}  // namespace voxdag
