// Recognizes files that voxdag does not read, by their first bytes: other formats of scenes and
// points, archives, compressed files, images, and text in another encoding.
#pragma once

#include <string>
#include <string_view>

#include "core/io/file_system.h"

namespace voxdag {

// Returns the first bytes of a file, which identify its format.
std::string first_bytes_of(const ReadableFile& file);

// Returns the format and a remedy for an error message, such as "is compressed by gzip: unpack it
// first". Returns "" for an unknown format. `begin` is the beginning of the file.
std::string describe_other_format(std::string_view begin);

// True if the first bytes identify a text format that voxdag recognizes but does not read, such as
// a Git LFS pointer or a web page.
bool is_other_text(std::string_view begin);

// True if the first bytes contain control characters that do not occur in text in ASCII, UTF-8 or a
// similar encoding.
bool is_no_text(std::string_view begin);

// Returns the text without white space at its beginning.
std::string_view without_leading_space(std::string_view text);

}  // namespace voxdag
