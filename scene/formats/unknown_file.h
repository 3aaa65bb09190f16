// Refuses files that are not scenes, with a message about their format.
#pragma once

#include "core/io/file_system.h"

namespace voxdag {

// Throws Error{kInvalidInput} for a file of no known scene format. If the first bytes identify
// another format, the message names that format and a remedy. The message always lists the formats
// that voxdag reads.
[[noreturn]] void refuse_unknown_file(const ReadableFile& file);

}  // namespace voxdag
