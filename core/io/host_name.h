// The name of this machine, for messages: the writer of a lock or of a record on a shared disk.
#pragma once

#include <string>

namespace voxdag {

// As gethostname() gives it, cut to 255 bytes; "" if it gives none.
std::string host_name();

}  // namespace voxdag
