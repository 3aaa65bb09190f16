// Makes unpredictable names. The probability that two calls return the same name is negligible.
#pragma once

#include <string>

namespace voxdag {

// Returns 16 hex digits (64 bits) from the system's random number generator.
std::string random_id();

}  // namespace voxdag
