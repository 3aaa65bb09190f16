// Sizes as people write them: "512MiB", "8GiB", "64M" (binary), "1000000".
#pragma once

#include <cstdint>
#include <string>

namespace voxdag {

// Throws Error{kInvalidInput} naming `option` unless the text is a number with an optional unit.
uint64_t parse_size(const std::string& text, const std::string& option);
// "1.25 GiB"
std::string size_text(uint64_t bytes);
// "2 567 687 158"
std::string count_text(uint64_t count);
// "1 m 04 s", "12.3 s"
std::string duration_text(double seconds);

}  // namespace voxdag
