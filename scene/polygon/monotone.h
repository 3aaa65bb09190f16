// Triangulates a monotone ring: its lower and its upper chain both visit their corners in the order
// of the sweep.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "scene/polygon/sweep.h"

namespace voxdag::polygon {

class MonotoneTriangulation {
 public:
  // `corners` are the corners that `sweep` has divided. Both must outlive this object.
  MonotoneTriangulation(const Sweep& sweep, std::span<const Point> corners)
      : sweep_(sweep), corners_(corners) {}

  // Appends the triangles of a ring, three corners each. `ring` lists its corners in
  // counterclockwise order. Takes O(n) time for n corners. Returns false if the ring is not
  // monotone or a triangle would be clockwise.
  bool add(std::span<const uint32_t> ring, std::vector<uint32_t>& triangles);

 private:
  struct Entry {
    uint32_t corner;
    bool is_lower;  // true: the corner is in the lower chain
  };

  bool merge_chains(std::span<const uint32_t> ring);
  bool add_corner(const Entry& entry, std::vector<uint32_t>& triangles);
  bool add_triangle(const Entry& a, const Entry& b, const Entry& c,
                    std::vector<uint32_t>& triangles) const;
  int side(const Entry& a, const Entry& b, const Entry& c) const;

  const Sweep& sweep_;
  const std::span<const Point> corners_;
  std::vector<Entry> order_;  // the corners of the ring in the order of the sweep
  std::vector<Entry> open_;   // corners of one chain that still lack triangles
};

}  // namespace voxdag::polygon
