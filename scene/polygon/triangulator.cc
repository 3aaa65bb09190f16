#include "scene/polygon/triangulator.h"

#include "scene/polygon/monotone.h"
#include "scene/polygon/projection.h"

namespace voxdag::polygon {

bool Triangulator::triangulate(std::span<double> xyz) {
  is_doubtful_ = false;
  if (xyz.size() == 9 || is_clear_fan(xyz) || !normalize(xyz)) return false;
  const Projection projection = choose_projection(xyz);
  if (projection.is_fan) return false;
  charge_.grow_to(xyz.size() / 3 * kBytesPerCorner);
  project(xyz, projection, points_);
  is_doubtful_ = !triangulate_projected();
  return !is_doubtful_;
}

bool Triangulator::triangulate_projected() {
  triangles_.clear();
  triangles_.reserve(3 * points_.size());
  remove_collinear_corners();
  const size_t removed = triangles_.size();
  const size_t all = 3 * (points_.size() - 2);
  for (const Sweep::Move move : {Sweep::Move::kInward, Sweep::Move::kOutward}) {
    triangles_.resize(removed);
    if ((kept_.size() < 3 || triangulate_kept(move)) && triangles_.size() == all) return true;
  }
  return false;
}

// Removes corners that are collinear with their two neighbors, until there are no more such corners
// or only two corners remain. Adds a degenerate triangle for each removed corner. Sets kept_ to the
// remaining corners.
void Triangulator::remove_collinear_corners() {
  Rings& ring = sweep_.rings();
  ring.reset(static_cast<uint32_t>(points_.size()));
  const auto side = [&](uint32_t a, uint32_t b, uint32_t c) {
    return orientation(points_[a], points_[b], points_[c]);
  };
  size_t left = points_.size();
  uint32_t corner = 0;
  for (size_t checked = 0; checked < left && left > 2;) {
    const auto [_, previous, next] = ring[corner];
    if (side(previous, corner, next) != 0) {
      ++checked;
      corner = next;
      continue;
    }
    triangles_.insert(triangles_.end(), {previous, corner, next});
    ring.remove(corner);
    --left;
    checked = 0;
    corner = previous;
  }
  kept_.clear();
  for (; kept_.size() < left; corner = ring[corner].next) kept_.push_back(corner);
}

// Triangulates the polygon that the corners in kept_ form, and adds its triangles. Returns false if
// the sweep fails or a triangle would be clockwise.
bool Triangulator::triangulate_kept(Sweep::Move move) {
  kept_points_.clear();
  for (const uint32_t corner : kept_) kept_points_.push_back(points_[corner]);
  if (!sweep_.divide(kept_points_, move)) return false;
  MonotoneTriangulation monotone(sweep_, kept_points_);
  const Rings& rings = sweep_.rings();
  const size_t before = triangles_.size();
  is_visited_.assign(rings.size(), false);
  for (uint32_t first = 0; first < rings.size(); ++first) {
    if (is_visited_[first]) continue;
    ring_.clear();
    for (uint32_t node = first; !is_visited_[node]; node = rings[node].next) {
      is_visited_[node] = true;
      ring_.push_back(rings[node].corner);
    }
    if (!monotone.add(ring_, triangles_)) return false;
  }
  for (size_t i = before; i < triangles_.size(); ++i) triangles_[i] = kept_[triangles_[i]];
  return true;
}

}  // namespace voxdag::polygon
