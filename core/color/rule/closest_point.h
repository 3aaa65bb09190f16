// The point of a triangle that is closest to a cell's center, for cells in which no triangle covers
// a column. Computed in IEEE doubles, in the order of the code: the exact position matters little,
// but it must be the same on all machines.
#pragma once

#include <array>
#include <cstdint>

#include "core/base/host_device.h"
#include "core/color/rule/surface_look.h"
#include "core/geometry/fixed_triangle.h"

namespace voxdag::color {

struct Vector {
  double x, y, z;
};
VOXDAG_HD inline Vector operator-(const Vector& a, const Vector& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
VOXDAG_HD inline double dot(const Vector& a, const Vector& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
VOXDAG_HD inline Vector cross(const Vector& a, const Vector& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// Returns the position of the point closest to the origin on the segment from a (position 0) to b
// (position 1). Sets `distance` to the square of the point's distance from the origin.
VOXDAG_HD inline double closest_on_segment(const Vector& a, const Vector& b, double& distance) {
  const Vector along = b - a;
  const double length = dot(along, along), forward = -dot(a, along);
  double t = 0;
  if (forward >= length)
    t = length > 0 ? 1 : 0;
  else if (forward > 0)
    t = forward / length;
  const Vector nearest{a.x + t * along.x, a.y + t * along.y, a.z + t * along.z};
  distance = dot(nearest, nearest);
  return t;
}

// Returns the projection of `center` on the triangle's plane if the triangle contains this point.
// Otherwise returns the closest point of the edges (on ties, of the first edge). `center`: the
// cell's center in lattice units (1/256 voxel).
VOXDAG_HD inline SurfacePoint closest_point(const FixedTriangle& triangle,
                                            const std::array<int64_t, 3>& center) {
  constexpr double kOne = static_cast<double>(kPointOne);
  Vector v[3];
  for (int i = 0; i < 3; ++i)
    v[i] = {static_cast<double>(triangle.v[i][0] - center[0]),
            static_cast<double>(triangle.v[i][1] - center[1]),
            static_cast<double>(triangle.v[i][2] - center[2])};
  const Vector normal = cross(v[1] - v[0], v[2] - v[0]);
  // opposite[i] is twice the area of the triangle between the center's projection and the edge
  // opposite to vertex i, times the length of `normal`. The value is negative if the projection is
  // on the outer side of this edge.
  const double opposite[3] = {dot(normal, cross(v[1], v[2])), dot(normal, cross(v[2], v[0])),
                              dot(normal, cross(v[0], v[1]))};
  const double all = opposite[0] + opposite[1] + opposite[2];
  if (opposite[0] >= 0 && opposite[1] >= 0 && opposite[2] >= 0 && all > 0)
    return surface_point(opposite[1] / all * kOne, opposite[2] / all * kOne);
  double best = 0, along = 0;
  int edge = 0;
  for (int i = 0; i < 3; ++i) {
    double distance;
    const double t = closest_on_segment(v[i], v[(i + 1) % 3], distance);
    if (i == 0 || distance < best) {
      best = distance;
      along = t;
      edge = i;
    }
  }
  if (edge == 0) return surface_point(along * kOne, 0);
  if (edge == 1) return surface_point((1 - along) * kOne, along * kOne);
  return surface_point(0, (1 - along) * kOne);
}

}  // namespace voxdag::color
