// Parts of the error messages and warnings about a scene file.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace voxdag {

// Returns a text from the file for use in a message. Quotes, and all characters that are not
// printable (core/base/text/printable.h), become question marks, so that the text cannot forge a
// line of a log or control a terminal. A text of over `max_bytes` is cut and ends with "...". The
// text may be of any encoding.
std::string printable(std::string_view text, size_t max_bytes = 64);

// Returns the message of an exception of the JSON library without its prefix in brackets, which
// begins with "[json.exception". Other messages are returned unchanged.
std::string without_prefix(std::string message);

// Returns the index with the name in quotes: 16 "wheel". Returns only the index if the name is
// empty.
std::string numbered(int index, const std::string& name);

// Returns the text that follows the name of a vertex or point in the message about an invalid
// triangle or point.
std::string not_finite();

// Throws Error{kInvalidInput}: "<scene file>: <what>".
[[noreturn]] void refuse(const std::string& path, const std::string& what);

}  // namespace voxdag
