// Parts of the error messages and warnings about a scene file.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace voxdag {

// Returns a text from the file for use in a message. Quotes, control characters and bytes that are
// not UTF-8 become question marks, so that the text cannot forge a line of a log. Control
// characters are below U+0020, or from U+007F to U+009F, because terminals also obey these. A text
// of over `max_bytes` is cut and ends with "...".
std::string printable(std::string_view text, size_t max_bytes = 64);

// Returns the message of an exception of the JSON library without its prefix "[json.exception...]
// ". Other messages are returned unchanged.
std::string without_prefix(std::string message);

// Returns the index with the name in quotes: 16 "wheel". Returns only the index if the name is
// empty.
std::string numbered(int index, const std::string& name);

// Throws Error{kInvalidInput}: "<scene file>: <what>".
[[noreturn]] void refuse(const std::string& path, const std::string& what);

}  // namespace voxdag
