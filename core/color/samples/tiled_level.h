// A level of an image's pyramid in memory. The level is cut into tiles of 32 x 32 texels, row by
// row. Tiles at the right and lower border are padded. The texels of a tile are consecutive, row by
// row, with eight bytes each: four linear channels of 16 bits, red in the lowest, then green, blue
// and alpha.
#pragma once

#include <cstddef>
#include <cstdint>

namespace voxdag {

inline constexpr uint32_t kTileShift = 5;
inline constexpr uint32_t kTileEdge = 1u << kTileShift;

struct TiledLevel {
  const uint64_t* texels = nullptr;
  uint32_t width = 0, height = 0;
  uint32_t row_of_tiles = 0;  // texels in a row of tiles
};

}  // namespace voxdag
