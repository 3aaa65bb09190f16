#include "core/color/blocks/region.h"

#include <algorithm>

#include "core/base/host_device.h"
#include "core/color/color_of.h"

namespace voxdag {

// Adds the colors of cells of the level that is `up` levels above the region's finest level. They
// have the same parent, and `code` is the code of any child of this parent.
inline void RegionEncoder::add_colors(uint32_t up, uint32_t code, std::span<const Color> colors) {
  constexpr uint32_t kPrefixBits = 3 * kPrefixLevels;
  uint32_t& added = region_.counts[up];
  if (up + kPrefixLevels < levels_ &&
      (added == 0 || code >> kPrefixBits != last_code_ >> kPrefixBits))
    region_.prefix.push_back(added);
  last_code_ = code;
  added += static_cast<uint32_t>(colors.size());
  for (const Color color : colors) colors_.push_back(color);
}

// Adds the sum of a cell to its parent. The cells of a level come in Morton order.
inline void RegionEncoder::add_to_parent(uint32_t code, const ColorSum& sum) {
  if (parents_.empty() || parents_.back().code != code >> 3)
    parents_.push_back({code >> 3, sum});
  else
    parents_.back().sum.add(sum);
}

// Adds cells of the level that is `up` levels above the region's finest level. The code of a cell
// is `first_code` + cell.code. Several calls can add the cells of a level, in Morton order.
template <class ColorOf>
void RegionEncoder::add_level(uint32_t up, std::span<const ColoredCell> cells, uint32_t first_code,
                              const ColorOf& color) {
  for (const ColoredCell& cell : cells) {
    const uint32_t code = first_code + cell.code;
    const Color stored = color(cell, code);
    add_colors(up, code, {&stored, 1});
    add_to_parent(code, cell.sum);
  }
}

void RegionEncoder::add_siblings(uint32_t code, std::span<const Color> colors,
                                 const ColorSum& sum) {
  add_colors(0, code, colors);
  add_to_parent(code, sum);
}

void RegionEncoder::add_level(uint32_t up, std::span<const ColoredCell> cells,
                              uint32_t first_code) {
  if (!color_)
    return add_level(up, cells, first_code,
                     [](const ColoredCell& cell, uint32_t) { return color_of(cell.sum); });
  add_level(up, cells, first_code, [&](const ColoredCell& cell, uint32_t code) {
    return color_(up, {code, cell.sum});
  });
}

void RegionEncoder::reserve(size_t cells) {
  if (!colors_.empty()) return;
  // The coarser levels usually have less than half as many cells in total.
  colors_.reserve(cells + cells / 2);
  parents_.reserve(std::min(cells, size_t{1} << 3 * levels_ >> 3));
}

void RegionEncoder::add(std::span<const ColoredCell> cells, uint32_t first_code) {
  reserve(cells.size());
  add_level(0, cells, first_code);
}

EncodedRegion RegionEncoder::finish(uint64_t morton) {
  std::vector<ColoredCell> cells;
  for (uint32_t up = 1; up <= levels_; ++up) {
    cells.swap(parents_);
    parents_.clear();
    add_level(up, cells, 0);
  }
  // The last level has one cell. Its parent, the only element of parents_, has the same sum.
  region_.total = parents_.front().sum;
  region_.morton = morton;
  const EncodeBlock encode_block = fastest_block_encoder();
  region_.blocks.resize((colors_.size() + kBlockCells - 1) / kBlockCells * kBlockBytes);
  for (size_t at = 0; at < colors_.size(); at += kBlockCells) {
    const ColorBlock block = encode_block(&colors_[at], std::min(kBlockCells, colors_.size() - at));
    std::copy(block.begin(), block.end(), &region_.blocks[at / kBlockCells * kBlockBytes]);
  }
  return std::move(region_);
}

EncodedRegion encode_region(uint32_t levels, uint64_t morton, std::span<const ColoredCell> cells,
                            const CellColor& color) {
  RegionEncoder encoder(levels, color);
  encoder.add(cells);
  return encoder.finish(morton);
}

namespace {

// Returns the cells of the next coarser level, in the same form as `cells` (encode_flat_region()).
std::vector<uint64_t> parents_of(std::span<const uint64_t> cells) {
  std::vector<uint64_t> parents((cells.size() + 7) / 8);
  for (size_t i = 0; i < cells.size(); ++i) {
    if (cells[i] == 0) continue;
    uint64_t any = cells[i] | cells[i] >> 4;
    any |= any >> 2;
    any = (any | any >> 1) & 0x0101010101010101;
    // The product has bit 8 k of `any`, the parent of the cells 8 k to 8 k + 7, at bit 56 + k.
    parents[i / 8] |= (any * 0x0102040810204080) >> 56 << i % 8 * 8;
  }
  return parents;
}

}  // namespace

EncodedRegion encode_flat_region(uint32_t levels, uint64_t morton, std::span<const uint64_t> cells,
                                 const FlatColor& color, uint64_t weight) {
  EncodedRegion region;
  region.morton = morton;
  color.add_to(region.total, weight);
  constexpr size_t kPrefixWords = (size_t{1} << 3 * kPrefixLevels) / 64;
  uint64_t all = 0;
  std::vector<uint64_t> coarser;
  for (uint32_t up = 0; up <= levels; ++up) {
    uint32_t& count = region.counts[up];
    for (size_t at = 0; at < cells.size(); at += kPrefixWords) {
      const uint32_t before = count;
      for (const uint64_t word : cells.subspan(at, std::min(kPrefixWords, cells.size() - at)))
        if (word != 0) count += static_cast<uint32_t>(popcount64(word));
      if (up + kPrefixLevels < levels && count != before) region.prefix.push_back(before);
    }
    all += count;
    coarser = parents_of(cells);
    cells = coarser;
  }
  const Color stored = color_of(region.total);
  const ColorBlock block = fastest_block_encoder()(&stored, 1);
  region.blocks.reserve((all + kBlockCells - 1) / kBlockCells * kBlockBytes);
  for (uint64_t at = 0; at < all; at += kBlockCells)
    region.blocks.insert(region.blocks.end(), block.begin(), block.end());
  return region;
}

}  // namespace voxdag
