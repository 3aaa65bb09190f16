// Makes unpredictable names. The probability that two calls return the same name is negligible.
#pragma once

#include <string>
#include <string_view>

namespace voxdag {

// Returns 16 hex digits (64 bits) from the system's random number generator.
std::string random_id();
// True if the text has the form of random_id().
bool is_random_id(std::string_view text);

}  // namespace voxdag
