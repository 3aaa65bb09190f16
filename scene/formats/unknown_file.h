// Names files that are not scenes, by their first bytes.
#pragma once

#include "core/io/file_system.h"

namespace voxdag {

// Throws Error{kInvalidInput} for a file of no known scene format. The message states the format,
// if the first bytes identify one, a remedy, and the formats that voxdag reads.
[[noreturn]] void refuse_unknown_file(const ReadableFile& file);

}  // namespace voxdag
