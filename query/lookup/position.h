// Positions in a grid.
#pragma once

#include <array>
#include <cstdint>

namespace voxdag::query {

// x, y and z in cells of a grid. An array of them is a table of three int64 columns.
using Position = std::array<int64_t, 3>;

}  // namespace voxdag::query
