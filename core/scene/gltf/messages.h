// Parts of the error messages and warnings about a scene file.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace voxdag::gltf {

// A text from the file as messages show it: control characters and quotes replaced, and shortened
// to `max_bytes`, so that it can forge no line of a log.
std::string printable(std::string_view text, size_t max_bytes = 64);

// "16 \"name\"", or only the number of an object without a name.
std::string numbered(int index, const std::string& name);

// Throws Error{kInvalidInput}: "<scene file>: <what>".
[[noreturn]] void refuse(const std::string& path, const std::string& what);

}  // namespace voxdag::gltf
