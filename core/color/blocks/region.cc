#include "core/color/blocks/region.h"

#include <algorithm>

#include "core/color/color_of.h"

namespace voxdag {
namespace {

// Appends the cells' colors, color(cell) each; `parents` become their parents, in order.
template <class ColorOf>
void add_colors(std::span<const ColoredCell> cells, const ColorOf& color,
                std::vector<Color>& colors, std::vector<ColoredCell>& parents) {
  for (const ColoredCell& cell : cells) {
    colors.push_back(color(cell));
    const uint32_t code = cell.code >> 3;
    if (parents.empty() || parents.back().code != code)
      parents.push_back({code, cell.sum});
    else
      parents.back().sum.add(cell.sum);
  }
}

void add_prefix(std::span<const ColoredCell> cells, std::vector<uint32_t>& prefix) {
  constexpr uint32_t kBits = 3 * kPrefixLevels;
  for (size_t i = 0; i < cells.size(); ++i)
    if (i == 0 || cells[i].code >> kBits != cells[i - 1].code >> kBits)
      prefix.push_back(static_cast<uint32_t>(i));
}

// color(up, cell) is the stored color.
template <class ColorOfCell>
EncodedRegion encode(uint32_t levels, uint64_t morton, std::span<const ColoredCell> cells,
                     const ColorOfCell& color) {
  EncodedRegion region;
  region.morton = morton;
  std::vector<Color> colors;
  colors.reserve(cells.size() + cells.size() / 2);
  std::vector<ColoredCell> coarser, parents;
  for (uint32_t i = 0;; ++i) {
    region.counts[i] = static_cast<uint32_t>(cells.size());
    add_colors(
        cells, [&](const ColoredCell& cell) { return color(i, cell); }, colors, parents);
    if (i + kPrefixLevels < levels) add_prefix(cells, region.prefix);
    if (i == levels) break;
    coarser.swap(parents);
    parents.clear();
    cells = coarser;
  }
  region.total = cells.front().sum;
  const EncodeBlock encode_block = fastest_block_encoder();
  region.blocks.resize((colors.size() + kBlockCells - 1) / kBlockCells * kBlockBytes);
  for (size_t at = 0; at < colors.size(); at += kBlockCells) {
    const ColorBlock block = encode_block(&colors[at], std::min(kBlockCells, colors.size() - at));
    std::copy(block.begin(), block.end(), &region.blocks[at / kBlockCells * kBlockBytes]);
  }
  return region;
}

}  // namespace

EncodedRegion encode_region(uint32_t levels, uint64_t morton, std::span<const ColoredCell> cells) {
  return encode(levels, morton, cells,
                [](uint32_t, const ColoredCell& cell) { return color_of(cell.sum); });
}

EncodedRegion encode_region(uint32_t levels, uint64_t morton, std::span<const ColoredCell> cells,
                            const CellColor& color) {
  return encode(levels, morton, cells, color);
}

}  // namespace voxdag
