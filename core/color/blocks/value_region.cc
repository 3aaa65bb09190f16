#include "core/color/blocks/value_region.h"

#include <algorithm>

#include "core/color/color_of.h"

namespace voxdag {
namespace {

uint32_t mean_alpha(std::span<const uint32_t> alphas) {
  uint32_t sum = 0;
  for (const uint32_t alpha : alphas) sum += alpha;
  const auto count = static_cast<uint32_t>(alphas.size());
  return (2 * sum + count) / (2 * count);
}

uint32_t sum_of_normals(std::span<const uint32_t> normals) {
  if (std::ranges::all_of(normals, [&](uint32_t normal) { return normal == normals.front(); }))
    return normals.front();
  std::array<int64_t, 3> sum{};
  for (const uint32_t normal : normals) {
    const auto direction = decode_normal(static_cast<NormalCode>(normal));
    for (size_t a = 0; a < 3; ++a) sum[a] += direction[a];
  }
  if (sum == std::array<int64_t, 3>{}) return normals.front();
  return encode_normal(sum[0], sum[1], sum[2]);
}

uint32_t commonest(std::span<const uint32_t> materials) {
  uint32_t best = materials.front();
  std::ptrdiff_t times = 0;
  for (const uint32_t material : materials) {
    const std::ptrdiff_t n = std::ranges::count(materials, material);
    if (n < times || (n == times && material >= best)) continue;
    best = material;
    times = n;
  }
  return best;
}

void append_value(uint32_t value, uint32_t bytes, std::vector<std::byte>& out) {
  for (uint32_t b = 0; b < bytes; ++b) out.push_back(static_cast<std::byte>(value >> 8 * b));
}

// The parents of cells, in order.
void make_parents(Attribute attribute, std::span<const ValuedCell> cells,
                  std::vector<ValuedCell>& parents) {
  uint32_t values[8];
  for (size_t i = 0; i < cells.size();) {
    const uint32_t code = cells[i].code >> 3;
    size_t children = 0;
    for (; i < cells.size() && cells[i].code >> 3 == code; ++i) values[children++] = cells[i].value;
    parents.push_back({code, value_of_parent(attribute, std::span(values, children))});
  }
}

}  // namespace

uint32_t value_of_parent(Attribute attribute, std::span<const uint32_t> children) {
  if (attribute == Attribute::kAlpha) return mean_alpha(children);
  return attribute == Attribute::kNormal ? sum_of_normals(children) : commonest(children);
}

void append_values(Attribute attribute, std::span<const ColoredCell> cells,
                   std::span<const CellValues> values, uint32_t first_code,
                   std::vector<ValuedCell>& out) {
  out.reserve(out.size() + cells.size());
  for (size_t i = 0; i < cells.size(); ++i)
    out.push_back({first_code + cells[i].code, attribute == Attribute::kAlpha
                                                   ? alpha_of(cells[i].sum)
                                                   : value_of(values[i], attribute)});
}

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
