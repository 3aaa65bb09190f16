// Encodes the colors of a region as the file stores them. The cells of the region's finest level
// come first, in Morton order, then the cells of the next coarser level, and so on up to the one
// cell that is the region. The cells are stored in blocks of 32; each region begins a new block.
// The sum of a coarser cell is the sum of its children. Its color is made from this sum, not from
// the stored colors of the children.
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

// A cell's rank is counted within its ancestor this many levels above.
inline constexpr uint32_t kPrefixLevels = 4;

struct EncodedRegion {
  uint64_t morton = 0;  // code of the region among the cubes of its level
  std::array<uint32_t, kRegionLevels + 1> counts{};  // cells by level, the finest first
  std::vector<std::byte> blocks;
  // Two tables of ranks: for the finest level and for the next coarser level. A table exists if the
  // level that is kPrefixLevels above the table's level is below the region. The table has an entry
  // for each cell of that upper level, in Morton order: the number of cells of the table's level
  // that come before this cell.
  std::vector<uint32_t> prefix;
  ColorSum total;
};

// Returns the stored color of a cell `up` levels above the finest level. The cell's code belongs to
// its level.
using CellColor = std::function<Color(uint32_t up, const ColoredCell& cell)>;

// Encodes a region whose finest cells come in parts, so that their sums need not be in memory
// together. Memory: up to 10 bytes for each cell, and 81 for each cell of the next coarser level,
// in addition to the result.
class RegionEncoder {
 public:
  // `levels` is kRegionLevels, or less if the grid has fewer remaining levels. If `color` is not
  // null, it returns the cells' colors, which are used instead of their sums.
  explicit RegionEncoder(uint32_t levels, CellColor color = nullptr)
      : levels_(levels), color_(std::move(color)) {}
  // Adds cells in increasing order. Their codes are counted from `first_code`. The resulting codes
  // are below 8^levels.
  void add(std::span<const ColoredCell> cells, uint32_t first_code = 0);
  bool empty() const { return colors_.empty(); }
  // Call it once, at the end. Requires at least one cell.
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
  std::vector<ColoredCell> parents_;  // cells of the level that was added last
  uint32_t last_code_ = 0;            // code of a cell of this level
};

// Encodes all cells in one call. Thread-safe.
EncodedRegion encode_region(uint32_t levels, uint64_t morton, std::span<const ColoredCell> cells,
                            const CellColor& color = nullptr);

// Returns the number of entries of `prefix` for these counts.
inline size_t prefix_entries(uint32_t levels,
                             const std::array<uint32_t, kRegionLevels + 1>& counts) {
  size_t entries = 0;
  for (uint32_t i = 0; i + kPrefixLevels < levels; ++i) entries += counts[i + kPrefixLevels];
  return entries;
}

}  // namespace voxdag
