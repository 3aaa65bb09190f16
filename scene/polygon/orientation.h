// The orientation of three points of the plane, computed exactly.
#pragma once

namespace voxdag::polygon {

struct Point {
  double x = 0, y = 0;
  bool operator==(const Point&) const = default;
};

// Returns 1 if a, b, c run counterclockwise, -1 if they run clockwise, 0 if they are collinear. The
// result is exact if the magnitudes of all coordinates are 0 or from 2^-480 to 1.
int orientation(const Point& a, const Point& b, const Point& c);

}  // namespace voxdag::polygon
