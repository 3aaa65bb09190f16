// Parts of the error messages and warnings about a scene file.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace voxdag {

// A text from the file as messages show it: control characters (those of one byte and those
// of U+0080 to U+009F, which terminals obey too) and quotes replaced, and shortened
// to `max_bytes`, so that it can forge no line of a log.
std::string printable(std::string_view text, size_t max_bytes = 64);

// The message of an exception of the JSON library, without the "[json.exception...] " that it
// begins with; other messages as they are.
std::string without_prefix(std::string message);

// "16 \"name\"", or only the number of an object without a name.
std::string numbered(int index, const std::string& name);

// Throws Error{kInvalidInput}: "<scene file>: <what>".
[[noreturn]] void refuse(const std::string& path, const std::string& what);

}  // namespace voxdag
