// Names that nobody can guess or meet twice.
#pragma once

#include <string>

namespace voxdag::server {

// 16 hex digits from the system's source of randomness.
std::string random_id();

}  // namespace voxdag::server
