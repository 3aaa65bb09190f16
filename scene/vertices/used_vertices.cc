#include "scene/vertices/used_vertices.h"

#include <algorithm>

namespace voxdag {

void UsedVertices::find(std::span<const uint32_t> corners) {
  const auto [low, high] = std::ranges::minmax(corners);
  vertices_.clear();
  highest_ = high;
  if (high - low > kMaxRange) {
    vertices_.assign(corners.begin(), corners.end());
    return;
  }
  is_used_.assign(high - low + 1, 0);
  for (const uint32_t corner : corners) is_used_[corner - low] = 1;
  for (uint32_t i = 0; i <= high - low; ++i)
    if (is_used_[i]) vertices_.push_back(low + i);
}

bool UsedVertices::add_to(WorldBounds& bounds, VertexCache& positions, uint64_t count) const {
  if (highest_ >= count) return false;
  WorldBounds found{.empty = false};
  const double* const first = positions.at(vertices_[0]);
  std::copy_n(first, 3, found.low.begin());
  std::copy_n(first, 3, found.high.begin());
  for (const uint32_t vertex : vertices_) {
    const double* const position = positions.at(vertex);
    for (size_t a = 0; a < 3; ++a) {
      found.low[a] = std::min(found.low[a], position[a]);
      found.high[a] = std::max(found.high[a], position[a]);
    }
  }
  if (!positions.all_finite()) return false;
  bounds.add(found);
  return true;
}

}  // namespace voxdag
