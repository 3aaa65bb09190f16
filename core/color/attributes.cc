#include "core/color/attributes.h"

#include <algorithm>
#include <array>

#include "core/color/cell_values.h"
#include "core/color/color_of.h"

namespace voxdag::attribute_rules {

uint32_t alpha_of_cell(const ColorSum& sum, const CellValues&) { return alpha_of(sum); }
uint32_t normal_of_cell(const ColorSum&, const CellValues& values) { return values.normal; }
uint32_t material_of_cell(const ColorSum&, const CellValues& values) { return values.material; }

uint32_t mean_alpha(std::span<const uint32_t> children) {
  uint32_t sum = 0;
  for (const uint32_t alpha : children) sum += alpha;
  const auto count = static_cast<uint32_t>(children.size());
  return (2 * sum + count) / (2 * count);
}

uint32_t mean_normal(std::span<const uint32_t> children) {
  if (std::ranges::all_of(children, [&](uint32_t normal) { return normal == children.front(); }))
    return children.front();
  std::array<int64_t, 3> sum{};
  for (const uint32_t normal : children) {
    const auto direction = decode_normal(static_cast<NormalCode>(normal));
    for (size_t a = 0; a < 3; ++a) sum[a] += direction[a];
  }
  if (sum == std::array<int64_t, 3>{}) return children.front();
  return encode_normal(sum[0], sum[1], sum[2]);
}

uint32_t commonest(std::span<const uint32_t> children) {
  uint32_t best = children.front();
  std::ptrdiff_t times = 0;
  for (const uint32_t value : children) {
    const std::ptrdiff_t n = std::ranges::count(children, value);
    if (n < times || (n == times && value >= best)) continue;
    best = value;
    times = n;
  }
  return best;
}

}  // namespace voxdag::attribute_rules
