// Writes times for answers and messages.
#pragma once

#include <string>

namespace voxdag::server {

// Returns the text of a Unix time, such as "2026-11-21T07:00:00.123Z"; "" for the time 0.
std::string time_text(double unix_s);

}  // namespace voxdag::server
