// Measures how many pages of a file one picture reads if no page of the file is in memory.
#pragma once

#include <string>

namespace voxdag::query {

// Casts one ray with the width of a pixel through each pixel of the view `auto` of `voxdag render`,
// and prints the major page faults: once while the system reads single pages, as over a network or
// with little memory, and once with read-ahead.
void measure_cold(const std::string& path);

}  // namespace voxdag::query
