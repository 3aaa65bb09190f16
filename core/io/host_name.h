// The name of this machine, for people: what a lock or a record of a shared disk was written by.
#pragma once

#include <string>

namespace voxdag {

// As gethostname() gives it, cut to 255 bytes; "" if it gives none.
std::string host_name();

}  // namespace voxdag
