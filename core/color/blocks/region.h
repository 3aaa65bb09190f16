// Encodes the colors of a region as the file stores them. The cells of the region's finest level
// come first, in Morton order. The cells of the next coarser level follow, and so on. The last cell
// is the region itself. The cells are stored in blocks of 32; each region begins a new block. The
// sum of a coarser cell is the sum of its children. The color of a coarser cell is computed from
// this sum, not from the stored colors of the children.
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

// A table in EncodedRegion::prefix is for the cells of one level. It has an entry for each cube
// kPrefixLevels above this level: the number of cells of the level that come before the cube. A
// reader adds this number to the rank of a cell within the cube. The sum is the rank of the cell
// among all cells of its level in the region.
inline constexpr uint32_t kPrefixLevels = 4;

struct EncodedRegion {
  uint64_t morton = 0;  // Morton code of the region among the cubes of its level
  std::array<uint32_t, kRegionLevels + 1> counts{};  // cells by level, the finest first
  std::vector<std::byte> blocks;
  // Up to two tables of ranks, for the finest level and then for the next coarser level. A table
  // has an entry for each cell that is kPrefixLevels above the table's level, in Morton order: the
  // number of cells of the table's level that come before this cell's descendants. There is no
  // table for a level if the cells kPrefixLevels above it would be the region itself or larger.
  std::vector<uint32_t> prefix;
  ColorSum total;  // sum of the region's cells
};

// Returns the stored color of a cell `up` levels above the finest level. The cell's code is its
// Morton code among the region's cells of this level.
using CellColor = std::function<Color(uint32_t up, const ColoredCell& cell)>;

// Encodes a region whose finest cells come in parts, so that their sums need not all be in memory
// at the same time. Memory: up to 10 bytes for each cell of the finest level, and 81 bytes for each
// cell of the next coarser level, in addition to the result.
class RegionEncoder {
 public:
  // `levels` is the number of levels from the region down to its finest cells: kRegionLevels, or
  // less if the grid of these cells has fewer levels. If `color` is not null, it returns the colors
  // of the cells. Otherwise colors are computed from the cells' sums.
  explicit RegionEncoder(uint32_t levels, CellColor color = nullptr)
      : levels_(levels), color_(std::move(color)) {}
  // Adds cells of the finest level in increasing order of their codes. The code of a cell in the
  // region is `first_code` + cell.code, which is below 8^levels.
  void add(std::span<const ColoredCell> cells, uint32_t first_code = 0);
  // Reserves memory for a region of which the first part has `cells` cells of the finest level.
  void reserve(size_t cells);
  // Adds the 1 to 8 cells of the finest level that have the same parent. `code` is the code of the
  // parent's first child, whether or not this child is set. `colors` has the color_of() each cell,
  // and `sum` is the sum of all these cells. Requires that the constructor got no CellColor.
  void add_siblings(uint32_t code, std::span<const Color> colors, const ColorSum& sum);
  bool empty() const { return colors_.empty(); }
  // Returns the encoded region. Call it once, at the end. Requires at least one cell.
  EncodedRegion finish(uint64_t morton);

 private:
  void add_colors(uint32_t up, uint32_t code, std::span<const Color> colors);
  void add_to_parent(uint32_t code, const ColorSum& sum);
  template <class ColorOf>
  void add_level(uint32_t up, std::span<const ColoredCell> cells, uint32_t first_code,
                 const ColorOf& color);
  void add_level(uint32_t up, std::span<const ColoredCell> cells, uint32_t first_code);

  const uint32_t levels_;
  const CellColor color_;
  EncodedRegion region_;
  std::vector<Color> colors_;
  std::vector<ColoredCell> parents_;  // parents of the cells of the level that is being added
  uint32_t last_code_ = 0;            // code of the last cell of the level that is being added
};

// Encodes all cells in one call. Thread-safe.
EncodedRegion encode_region(uint32_t levels, uint64_t morton, std::span<const ColoredCell> cells,
                            const CellColor& color = nullptr);

// Encodes a region in which all surfaces have the flat color `color`. The result equals the result
// of encode_region() for the sums of the cells. `cells` has a bit for each cell of the finest
// level: bit i % 64 of element i / 64 is set if the cell with the Morton code i is set. At least
// one cell must be set. `weight` is the sum of the weights of all surfaces in all cells, below
// 2^40.
EncodedRegion encode_flat_region(uint32_t levels, uint64_t morton, std::span<const uint64_t> cells,
                                 const FlatColor& color, uint64_t weight);

// Returns the number of entries of EncodedRegion::prefix for a region with these counts.
inline size_t prefix_entries(uint32_t levels,
                             const std::array<uint32_t, kRegionLevels + 1>& counts) {
  size_t entries = 0;
  for (uint32_t i = 0; i + kPrefixLevels < levels; ++i) entries += counts[i + kPrefixLevels];
  return entries;
}

}  // namespace voxdag
