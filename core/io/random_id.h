// Names that cannot be guessed and do not occur twice.
#pragma once

#include <string>

namespace voxdag {

// 16 hex digits (64 bits) from the system's random number generator.
std::string random_id();

}  // namespace voxdag
