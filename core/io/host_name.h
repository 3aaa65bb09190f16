// The name of this machine, for messages: the writer of a lock or of a record on a shared disk.
#pragma once

#include <string>

namespace voxdag {

// Returns the name from gethostname(), cut to 255 bytes; "" if none exists.
std::string host_name();

}  // namespace voxdag
