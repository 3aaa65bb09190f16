#include "tests/oracle/overlap.h"

#include <algorithm>

namespace oracle {
namespace {

// 128 bits are enough: the components of a normal are below 2^83, and a dot product with a point is
// below 2^125.
__extension__ typedef __int128 Wide;
using Axis = std::array<Wide, 3>;

Axis minus(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

Axis cross(const Axis& a, const Axis& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

Wide dot(const Axis& a, const Point& p) { return a[0] * p[0] + a[1] * p[1] + a[2] * p[2]; }

template <class Points>
std::pair<Wide, Wide> shadow(const Axis& axis, const Points& points) {
  Wide lowest = dot(axis, points[0]), highest = lowest;
  for (const Point& p : points) {
    lowest = std::min(lowest, dot(axis, p));
    highest = std::max(highest, dot(axis, p));
  }
  return {lowest, highest};
}

}  // namespace

bool touches(const Triangle& triangle, const Point& low, int64_t edge) {
  std::array<Point, 8> corners;
  for (int i = 0; i < 8; ++i)
    corners[i] = {low[0] + (i & 1 ? edge : 0), low[1] + (i & 2 ? edge : 0),
                  low[2] + (i & 4 ? edge : 0)};

  // The axes are the normals of the cube's faces, the normal of the triangle, and all cross
  // products of an edge of the cube with an edge of the triangle. The Minkowski difference of the
  // two bodies has no faces with other normals.
  const Axis unit[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const Axis edges[3] = {minus(triangle[1], triangle[0]), minus(triangle[2], triangle[1]),
                         minus(triangle[0], triangle[2])};
  std::vector<Axis> axes(unit, unit + 3);
  axes.push_back(cross(edges[0], edges[1]));
  for (const Axis& u : unit)
    for (const Axis& e : edges) axes.push_back(cross(u, e));

  for (const Axis& axis : axes) {
    const auto [t_least, t_most] = shadow(axis, triangle);
    const auto [c_least, c_most] = shadow(axis, corners);
    if (t_most < c_least || c_most < t_least) return false;
  }
  return true;
}

}  // namespace oracle
