// The name of this machine. Messages use it to tell which machine wrote a lock or a record on a
// shared disk.
#pragma once

#include <string>

namespace voxdag {

// Returns the name from gethostname(), cut to 255 bytes; "" if none exists.
std::string host_name();

}  // namespace voxdag
