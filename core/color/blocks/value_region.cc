#include "core/color/blocks/value_region.h"

namespace voxdag {
namespace {

void append_value(uint32_t value, uint32_t bytes, std::vector<std::byte>& out) {
  for (uint32_t b = 0; b < bytes; ++b) out.push_back(static_cast<std::byte>(value >> 8 * b));
}

// Appends the parents of `cells`, with their values, to `parents` in Morton order.
void make_parents(Attribute attribute, std::span<const ValuedCell> cells,
                  std::vector<ValuedCell>& parents) {
  const auto value_of_parent = traits_of(attribute).value_of_parent;
  uint32_t values[8];
  for (size_t i = 0; i < cells.size();) {
    const uint32_t code = cells[i].code >> 3;
    size_t children = 0;
    for (; i < cells.size() && cells[i].code >> 3 == code; ++i) values[children++] = cells[i].value;
    parents.push_back({code, value_of_parent(std::span(values, children))});
  }
}

}  // namespace

EncodedRegion encode_values(Attribute attribute, uint32_t bytes, uint32_t levels, uint64_t morton,
                            std::span<const ValuedCell> cells) {
  constexpr uint32_t kBits = 3 * kPrefixLevels;
  EncodedRegion region;
  region.morton = morton;
  region.blocks.reserve((cells.size() + cells.size() / 2 + kBlockCells) * bytes);
  std::vector<ValuedCell> coarser, parents;
  for (uint32_t i = 0;; ++i) {
    region.counts[i] = static_cast<uint32_t>(cells.size());
    for (const ValuedCell& cell : cells) append_value(cell.value, bytes, region.blocks);
    for (size_t at = 0; i + kPrefixLevels < levels && at < cells.size(); ++at)
      if (at == 0 || cells[at].code >> kBits != cells[at - 1].code >> kBits)
        region.prefix.push_back(static_cast<uint32_t>(at));
    if (i == levels) break;
    parents.clear();
    make_parents(attribute, cells, parents);
    coarser.swap(parents);
    cells = coarser;
  }
  const size_t block = kBlockCells * bytes;
  region.blocks.resize((region.blocks.size() + block - 1) / block * block);
  return region;
}

uint32_t value_of_region(const EncodedRegion& region, uint32_t bytes) {
  uint64_t cells = 0;
  for (const uint32_t count : region.counts) cells += count;
  return value_at(region.blocks.data(), cells - 1, bytes);
}

}  // namespace voxdag
