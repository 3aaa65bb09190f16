#include "scene/polygon/sweep.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

namespace voxdag::polygon {
namespace {

// Returns the unit vector from a to b.
Point direction(const Point& a, const Point& b) {
  const double x = b.x - a.x, y = b.y - a.y, length = std::sqrt(x * x + y * y);
  return length > 0 ? Point{x / length, y / length} : Point{};
}

}  // namespace

bool Sweep::divide(std::span<const Point> corners, Move move) {
  corners_ = corners;
  distance_ = move == Move::kInward ? 1 : -1;
  rings_.reset(count());
  edges_.clear();
  sort_corners();
  return std::ranges::all_of(order_, [&](uint32_t corner) { return add(corner); });
}

void Sweep::sort_corners() {
  order_.resize(count());
  std::iota(order_.begin(), order_.end(), 0);
  std::ranges::sort(order_, [&](uint32_t a, uint32_t b) { return is_before(a, b); });
  rank_.resize(count());
  for (uint32_t i = 0; i < count(); ++i) rank_[order_[i]] = i;
}

bool Sweep::is_before(uint32_t a, uint32_t b) const {
  const Point &p = corners_[a], &q = corners_[b];
  if (p != q) return std::tie(p.x, p.y) < std::tie(q.x, q.y);
  const Point move_p = movement(a), move_q = movement(b);
  return std::tie(move_p.x, move_p.y, a) < std::tie(move_q.x, move_q.y, b);
}

// Returns the movement of a corner if all edges move inward by distance_.
Point Sweep::movement(uint32_t corner) const {
  const Point& p = corners_[corner];
  const Point in = direction(corners_[previous(corner)], p);
  const Point out = direction(p, corners_[next(corner)]);
  const double divisor = 1 + (in.x * out.x + in.y * out.y);
  if (!(divisor > 0)) return {};
  const double scale = distance_ / divisor;
  return {-scale * (in.y + out.y), scale * (in.x + out.x)};
}

// True if `corner` is above the lower edge that begins at corner `edge`. The sweep line at `corner`
// must cross this edge. False if `corner` is an end of the edge.
bool Sweep::is_above(uint32_t corner, uint32_t edge) const {
  const uint32_t end = next(edge);
  if (corner == edge || corner == end) return false;
  const int side = orientation(corners_[edge], corners_[end], corners_[corner]);
  if (side != 0) return side > 0;
  const Point along = direction(corners_[edge], corners_[end]), move = movement(corner);
  return along.x * move.y - along.y * move.x > distance_;
}

// Moves the sweep line to `corner`. Returns false if edges are found to cross each other.
bool Sweep::add(uint32_t corner) {
  const auto above = std::ranges::partition_point(
      edges_, [&](const LowerEdge& edge) { return is_above(corner, edge.from); });
  const auto below = static_cast<size_t>(above - edges_.begin());
  const bool comes_from_left = rank_[previous(corner)] < rank_[corner];
  const bool goes_left = rank_[next(corner)] < rank_[corner];
  if (comes_from_left == goes_left)
    return goes_left ? add_right_end(corner, below) : add_left_end(corner, below);
  return add_between(corner, below, comes_from_left);
}

// Adds a corner whose two edges are to the right. `below` is the number of lower edges below the
// corner.
bool Sweep::add_left_end(uint32_t corner, size_t below) {
  const bool divides_area =
      orientation(corners_[previous(corner)], corners_[corner], corners_[next(corner)]) < 0;
  if (divides_area) {
    if (below == 0) return false;
    edges_[below - 1].helper_node = connect(below - 1, corner, false);
    edges_[below - 1].is_merge = false;
  }
  edges_.insert(edges_.begin() + static_cast<ptrdiff_t>(below), {corner, corner, false});
  return true;
}

// Adds a corner whose two edges are to the left. `below` is as in add_left_end().
bool Sweep::add_right_end(uint32_t corner, size_t below) {
  if (below == edges_.size() || edges_[below].from != previous(corner)) return false;
  connect(below, corner, true);
  edges_.erase(edges_.begin() + static_cast<ptrdiff_t>(below));
  const bool merges_areas =
      orientation(corners_[previous(corner)], corners_[corner], corners_[next(corner)]) < 0;
  if (!merges_areas) return true;
  if (below == 0) return false;
  edges_[below - 1].helper_node = connect(below - 1, corner, true);
  edges_[below - 1].is_merge = true;
  return true;
}

// Adds a corner with one edge on each side, at the lower or upper border of an area.
bool Sweep::add_between(uint32_t corner, size_t below, bool is_lower) {
  if (is_lower) {
    if (below == edges_.size() || edges_[below].from != previous(corner)) return false;
    connect(below, corner, true);
    edges_[below] = {corner, corner, false};
    return true;
  }
  if (below == 0) return false;
  edges_[below - 1].helper_node = connect(below - 1, corner, true);
  edges_[below - 1].is_merge = false;
  return true;
}

// Adds a diagonal from the helper of a lower edge to `node`, which is in the area above that edge.
// With `only_merges`, adds it only if is_merge is true for the edge. Returns the node that `node`'s
// corner has in the lowest ring that is open to the right.
uint32_t Sweep::connect(size_t edge, uint32_t node, bool only_merges) {
  if (only_merges && !edges_[edge].is_merge) return node;
  return rings_.divide(edges_[edge].helper_node, node);
}

}  // namespace voxdag::polygon
