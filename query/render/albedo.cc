#include "query/render/albedo.h"

#include <array>
#include <cmath>

#include "core/format/global/open_global.h"

namespace voxdag::query {
namespace {

// Returns a table: element i is the linear intensity, from 0 to 1, of the sRGB byte i (IEC
// 61966-2-1).
const std::array<double, 256>& linear_of() {
  static const std::array<double, 256> table = [] {
    std::array<double, 256> linear{};
    for (size_t i = 0; i < linear.size(); ++i) {
      const double s = static_cast<double>(i) / 255;
      linear[i] = s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
    }
    return linear;
  }();
  return table;
}

}  // namespace

Vec Albedo::of(const SurfaceHit& surface) {
  if (!cursor_) return kPlaster;
  const auto rgb = with_reader_errors([&] {
    return cursor_->color(surface.cell[0], surface.cell[1], surface.cell[2], surface.depth);
  });
  if (!rgb) return kPlaster;
  const auto& linear = linear_of();
  return {{linear[rgb->r], linear[rgb->g], linear[rgb->b]}};
}

}  // namespace voxdag::query
