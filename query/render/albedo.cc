#include "query/render/albedo.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/error.h"
#include "core/format/global/open_global.h"

namespace voxdag::query {
namespace {

// Returns a table: element i is the linear intensity, from 0 to 1, of the sRGB byte i (IEC
// 61966-2-1).
const std::array<double, 256>& linear_of() {
  static const std::array<double, 256> table = [] {
    std::array<double, 256> linear{};
    for (size_t i = 0; i < linear.size(); ++i) {
      linear[i] = linear_of_srgb_value(static_cast<double>(i) / 255);
    }
    return linear;
  }();
  return table;
}

// The color scale of Shade::kSharing in sRGB. The first color is for nodes that occur once in the
// octree, the last color for the most frequent brick. The lightness increases along the scale, so
// that the scale can also be printed in gray.
constexpr std::array<Vec, 5> kScale = {Vec{{0.27, 0.05, 0.37}}, Vec{{0.23, 0.32, 0.55}},
                                       Vec{{0.13, 0.57, 0.55}}, Vec{{0.37, 0.79, 0.38}},
                                       Vec{{0.99, 0.91, 0.14}}};
// Colors of the levels, sRGB. The colors of adjacent levels are easy to distinguish.
constexpr std::array<Vec, 7> kLevelColors = {Vec{{0.90, 0.62, 0.00}}, Vec{{0.34, 0.71, 0.91}},
                                             Vec{{0.00, 0.62, 0.45}}, Vec{{0.94, 0.89, 0.26}},
                                             Vec{{0.00, 0.45, 0.70}}, Vec{{0.84, 0.37, 0.00}},
                                             Vec{{0.80, 0.47, 0.65}}};

Vec linear_color(const Vec& srgb) {
  return {{linear_of_srgb_value(srgb[0]), linear_of_srgb_value(srgb[1]),
           linear_of_srgb_value(srgb[2])}};
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

double linear_of_srgb_value(double srgb) {
  return srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4);
}

Vec normal_color(const Vec& normal) { return linear_color(normal * 0.5 + Vec{{0.5, 0.5, 0.5}}); }

const std::vector<std::string>& shade_names() {
  static const std::vector<std::string> names = {"color", "sharing", "level", "normal"};
  return names;
}

Shade shade_named(const std::string& name) {
  const auto& names = shade_names();
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end())
    throw Error(ErrorCode::kInvalidInput,
                "shade '" + name + "': expected one of color, sharing, level, normal");
  return static_cast<Shade>(found - names.begin());
}

uint64_t shade_bytes(const DagView& dag, Shade shade) {
  if (shade != Shade::kSharing || dag.empty()) return 0;
  uint64_t words = 0;
  for (uint32_t level = 0; level + kBrickLevels <= dag.grid_levels(); ++level)
    words += dag.level(level).words.size() + 2;
  return words / 2 * sizeof(uint64_t);
}

ShadeColors::ShadeColors(const DagView& dag, Shade shade) : dag_(dag), shade_(shade) {
  if (shade == Shade::kSharing && !dag.empty()) count_places();
}

// Counts how often each node occurs in the octree, from the root to the bricks. The node's count is
// added to the count of each of its children. Counts that exceed 64 bits are UINT64_MAX.
void ShadeColors::count_places() {
  const uint32_t brick_level = dag_.grid_levels() - kBrickLevels;
  for (uint32_t level = 0; level <= brick_level; ++level)
    places_.emplace_back(dag_.level(level).words.size() / 2 + 1);
  places_[0][0] = 1;
  for (uint32_t level = 0; level < brick_level; ++level) {
    const bool wide = dag_.level(level + 1).wide;
    for (uint64_t at = 0; at < dag_.level(level).words.size();) {
      const DagView::Children children = dag_.children_of_node(level, at);
      for (int i = 0; i < 8; ++i) {
        if (!children.has(i)) continue;
        const uint64_t offset = dag_.offset(children, i);
        if (offset >= dag_.level(level + 1).words.size()) dag_.corrupt(level + 1, offset);
        uint64_t& places = places_[level + 1][offset / 2];
        if (__builtin_add_overflow(places, places_[level][at / 2], &places)) places = UINT64_MAX;
      }
      at += 1 + (static_cast<uint64_t>(kPopcount8[children.mask]) << wide);
    }
  }
  const uint64_t most = *std::ranges::max_element(places_[brick_level]);
  log_max_places_ = std::log(static_cast<double>(std::max<uint64_t>(most, 1)));
}

// Returns how often the node or brick of the visible cell occurs in the octree. If the cell is
// smaller than a brick, this is the brick that contains the cell.
uint64_t ShadeColors::places_at(const SurfaceHit& surface) const {
  const uint32_t brick_level = dag_.grid_levels() - kBrickLevels;
  const uint32_t end = std::min(surface.depth, brick_level);
  uint64_t offset = 0;
  for (uint32_t level = 0; level < end; ++level) {
    const uint32_t shift = surface.depth - level - 1;
    const auto bit = [&](int axis) { return static_cast<int>(surface.cell[axis] >> shift & 1); };
    const int octant = bit(0) << 2 | bit(1) << 1 | bit(2);
    const DagView::Children children = dag_.children_of_node(level, offset);
    if (!children.has(octant)) return 1;
    offset = dag_.offset(children, octant);
  }
  if (offset / 2 >= places_[end].size()) dag_.corrupt(end, offset);
  return std::max<uint64_t>(1, places_[end][offset / 2]);
}

Vec ShadeColors::of(const SurfaceHit& surface) const {
  if (shade_ == Shade::kNormal) return normal_color(surface.normal);
  if (shade_ == Shade::kLevel)
    return linear_color(kLevelColors[surface.depth % kLevelColors.size()]);
  const double share =
      log_max_places_ > 0 ? std::log(static_cast<double>(places_at(surface))) / log_max_places_ : 0;
  const double at = std::clamp(share, 0.0, 1.0) * (kScale.size() - 1);
  const auto below = std::min(static_cast<size_t>(at), kScale.size() - 2);
  return linear_color(mix(kScale[below], kScale[below + 1], at - static_cast<double>(below)));
}

}  // namespace voxdag::query
