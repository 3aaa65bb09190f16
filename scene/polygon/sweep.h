// Divides a polygon into monotone rings by diagonals inside the polygon, with a sweep over its
// corners (de Berg et al., "Computational Geometry", section 3.2). Takes O(n log n) comparisons for
// n corners. Not thread-safe.
//
// Corners are swept in increasing x; corners of equal x in increasing y. Corners and edges of a
// polygon may also touch or coincide. In these cases, the sweep uses the order that the corners and
// edges have after an infinitely small movement of all edges. kInward moves edges into the polygon.
// This separates the two coinciding edges of a bridge, which connects an outline to a hole.
// kOutward moves edges out of the polygon, which widens a neck of width 0 between two parts of the
// polygon.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "scene/polygon/orientation.h"
#include "scene/polygon/rings.h"

namespace voxdag::polygon {

class Sweep {
 public:
  enum class Move { kInward, kOutward };

  // Divides the polygon with these corners, which are in counterclockwise order. No three
  // consecutive corners are collinear. The corners must remain valid as long as the rings are used.
  // If there is no such division because edges cross each other, divide() usually returns false. It
  // may also return true, but then a ring is not monotone or has clockwise triangles.
  bool divide(std::span<const Point> corners, Move move);

  Rings& rings() { return rings_; }
  // Returns the position of a corner in the order of the sweep.
  uint32_t rank(uint32_t corner) const { return rank_[corner]; }

 private:
  // A lower edge of the polygon that crosses the sweep line. The area above the edge is inside. The
  // helper is the last node that was directly above the edge, with no other edge between the two.
  // At first, it is the edge's left end.
  struct LowerEdge {
    uint32_t from;         // the left corner; the right one is the next corner of the polygon
    uint32_t helper_node;  // the helper, a node at the border of the area above the edge
    bool is_merge;         // true if both edges of the helper are to the left of the helper
  };

  uint32_t previous(uint32_t corner) const { return corner == 0 ? count() - 1 : corner - 1; }
  uint32_t next(uint32_t corner) const { return corner + 1 == count() ? 0 : corner + 1; }
  uint32_t count() const { return static_cast<uint32_t>(corners_.size()); }
  void sort_corners();
  Point movement(uint32_t corner) const;
  bool is_before(uint32_t a, uint32_t b) const;
  bool is_above(uint32_t corner, uint32_t edge) const;
  bool add(uint32_t corner);
  bool add_left_end(uint32_t corner, size_t below);
  bool add_right_end(uint32_t corner, size_t below);
  bool add_between(uint32_t corner, size_t below, bool is_lower);
  uint32_t connect(size_t edge, uint32_t node, bool only_merges);

  std::span<const Point> corners_;
  double distance_ = 1;  // distance of the movement: 1 inward, -1 outward
  std::vector<uint32_t> order_, rank_;
  std::vector<LowerEdge> edges_;  // the edges that cross the sweep line, from bottom to top
  Rings rings_;
};

}  // namespace voxdag::polygon
