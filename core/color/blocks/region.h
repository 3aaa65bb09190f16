// The colors of a region, in the order and the bytes in which the file stores them: the cells of
// its finest level in Morton order, then the next coarser level, and so on up to the one cell that
// is the region, in blocks of 32 cells that begin again in each region. A coarser cell is the sum
// of its children, not the mean of their stored colors.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <utility>
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

// The stored color of a cell that is `up` levels above the finest one; its code belongs to its
// level.
using CellColor = std::function<Color(uint32_t up, const ColoredCell& cell)>;

// Encodes a region whose finest cells come in parts, so that their sums need not be in memory
// together. Memory: up to 10 bytes for each cell, and 81 for each cell of the next coarser level,
// in addition to the result.
class RegionEncoder {
 public:
  // `levels` is kRegionLevels, or less where the grid has fewer remaining levels. If `color` is not
  // null, it gives the cells' colors instead of their sums.
  explicit RegionEncoder(uint32_t levels, CellColor color = nullptr)
      : levels_(levels), color_(std::move(color)) {}
  // The next cells in increasing order, their codes counted from `first_code`; with that, they are
  // below 8^levels.
  void add(std::span<const ColoredCell> cells, uint32_t first_code = 0);
  bool empty() const { return colors_.empty(); }
  // Requires at least one cell. Called once, at the end.
  EncodedRegion finish(uint64_t morton);

 private:
  template <class ColorOf>
  void add_level(uint32_t up, std::span<const ColoredCell> cells, uint32_t first_code,
                 const ColorOf& color);
  void add_level(uint32_t up, std::span<const ColoredCell> cells, uint32_t first_code);

  const uint32_t levels_;
  const CellColor color_;
  EncodedRegion region_;
  std::vector<Color> colors_;
  std::vector<ColoredCell> parents_;  // of the level that was added last
  uint32_t last_code_ = 0;            // of a cell of that level
};

// Encodes all cells in one call. Thread-safe.
EncodedRegion encode_region(uint32_t levels, uint64_t morton, std::span<const ColoredCell> cells,
                            const CellColor& color = nullptr);

// How many entries `prefix` has with these counts.
inline size_t prefix_entries(uint32_t levels,
                             const std::array<uint32_t, kRegionLevels + 1>& counts) {
  size_t entries = 0;
  for (uint32_t i = 0; i + kPrefixLevels < levels; ++i) entries += counts[i + kPrefixLevels];
  return entries;
}

}  // namespace voxdag
