// The colors of a region, in the order and the bytes in which the file stores them: the cells of
// its finest level in Morton order, then those of the next coarser one, and so on down to the one
// cell that is the region, in blocks of 32 cells that begin again in each region. A coarser cell is
// the sum of its children, not the mean of their stored colors.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/color/blocks/block_codec.h"
#include "core/color/color_sum.h"
#include "core/color/rule/color_grid.h"

namespace voxdag {

// The rank of a cell is counted from its ancestor so many levels above.
inline constexpr uint32_t kPrefixLevels = 4;

struct EncodedRegion {
  uint64_t morton = 0;                               // of the region, among the cubes of its level
  std::array<uint32_t, kRegionLevels + 1> counts{};  // cells by level, the finest first
  std::vector<std::byte> blocks;
  // For the finest level and the next one, where kPrefixLevels above it there is a level below the
  // region: for each cell of that level, in Morton order, the cells of the finer one before it.
  std::vector<uint32_t> prefix;
  ColorSum total;
};

// `levels` is kRegionLevels, or less where a grid, or what is left of its levels, has less; at
// least 1 cell in increasing order, with codes below 8^levels. Thread-safe. Memory: up to 17 bytes
// for each cell, and 72 for each cell of the next coarser level, aside from what is returned.
EncodedRegion encode_region(uint32_t levels, uint64_t morton, std::span<const ColoredCell> cells);

// The stored color of a cell that is `up` levels above the finest one; its code is that of its
// level.
using CellColor = std::function<Color(uint32_t up, const ColoredCell& cell)>;
// The same with other colors than those of the sums.
EncodedRegion encode_region(uint32_t levels, uint64_t morton, std::span<const ColoredCell> cells,
                            const CellColor& color);

// How many entries `prefix` has with these counts.
inline size_t prefix_entries(uint32_t levels,
                             const std::array<uint32_t, kRegionLevels + 1>& counts) {
  size_t entries = 0;
  for (uint32_t i = 0; i + kPrefixLevels < levels; ++i) entries += counts[i + kPrefixLevels];
  return entries;
}

}  // namespace voxdag
