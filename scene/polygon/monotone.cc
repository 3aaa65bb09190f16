#include "scene/polygon/monotone.h"

#include <algorithm>

namespace voxdag::polygon {

bool MonotoneTriangulation::add(std::span<const uint32_t> ring, std::vector<uint32_t>& triangles) {
  if (!merge_chains(ring)) return false;
  open_.assign(order_.begin(), order_.begin() + 2);
  open_[0].is_lower = open_[1].is_lower;
  for (size_t i = 2; i + 1 < order_.size(); ++i)
    if (!add_corner(order_[i], triangles)) return false;
  // The last corner ends both chains. Here it counts as a corner of the chain without open corners,
  // so that it forms triangles with all open corners.
  return add_corner({order_.back().corner, !open_.back().is_lower}, triangles);
}

// Sorts the corners of a ring by merging its two chains.
bool MonotoneTriangulation::merge_chains(std::span<const uint32_t> ring) {
  const size_t n = ring.size();
  const auto rank = [&](size_t i) { return sweep_.rank(ring[i % n]); };
  const auto first = static_cast<size_t>(
      std::ranges::min_element(ring, {}, [&](uint32_t c) { return sweep_.rank(c); }) -
      ring.begin());
  order_.assign(1, {ring[first], false});
  size_t lower = first + 1, upper = first + n - 1;
  uint32_t last_lower = rank(first), last_upper = last_lower;
  while (lower <= upper) {
    const bool is_lower = rank(lower) < rank(upper);
    uint32_t& last = is_lower ? last_lower : last_upper;
    const size_t i = is_lower ? lower++ : upper--;
    if (rank(i) <= last) return false;
    last = rank(i);
    order_.push_back({ring[i % n], is_lower});
  }
  return n >= 3;
}

bool MonotoneTriangulation::add_corner(const Entry& entry, std::vector<uint32_t>& triangles) {
  if (entry.is_lower != open_.back().is_lower) {
    for (size_t i = 0; i + 1 < open_.size(); ++i) {
      const bool ok = entry.is_lower ? add_triangle(entry, open_[i + 1], open_[i], triangles)
                                     : add_triangle(open_[i], open_[i + 1], entry, triangles);
      if (!ok) return false;
    }
    open_ = {open_.back(), entry};
    open_[0].is_lower = entry.is_lower;
    return true;
  }
  while (open_.size() > 1) {
    const Entry &last = open_.back(), &before = open_[open_.size() - 2];
    const Entry &a = entry.is_lower ? before : entry, &c = entry.is_lower ? entry : before;
    if (side(a, last, c) <= 0) break;
    add_triangle(a, last, c, triangles);
    open_.pop_back();
  }
  open_.push_back(entry);
  return true;
}

bool MonotoneTriangulation::add_triangle(const Entry& a, const Entry& b, const Entry& c,
                                         std::vector<uint32_t>& triangles) const {
  triangles.insert(triangles.end(), {a.corner, b.corner, c.corner});
  return side(a, b, c) >= 0;
}

int MonotoneTriangulation::side(const Entry& a, const Entry& b, const Entry& c) const {
  return orientation(corners_[a.corner], corners_[b.corner], corners_[c.corner]);
}

}  // namespace voxdag::polygon
