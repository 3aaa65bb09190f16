// The name of this machine. Messages contain it, so that users see which machine wrote a lock or a
// record on a shared disk.
#pragma once

#include <string>

namespace voxdag {

// Returns the name from gethostname(), cut to 255 bytes; "" if the machine has no name.
std::string host_name();

}  // namespace voxdag
