#include "query/render/surface_hit.h"

#include <algorithm>

namespace voxdag::query {
namespace {

constexpr int kReach = 3;  // cells on each side of the hit cell

Vec face_normal(const Hit& hit, const Vec& direction) {
  if (hit.axis < 0) return direction * -1.0;
  Vec normal;
  normal[hit.axis] = direction[hit.axis] > 0 ? -1 : 1;
  return normal;
}

// Weighted sums over the occupied cells near the hit cell. d is a cell's offset from the hit cell,
// in cells, and w its weight: `weight` is the sum of w, `first` of w d, and `second` of the matrix
// w d d^T.
struct Moments {
  double weight = 0;
  Vec first;
  Vec second[3];
};

Moments moments_around(const DagView& dag, const Hit& hit) {
  const double edge = static_cast<double>(dag.resolution() >> hit.depth), reach = kReach * edge;
  Vec low;
  for (int axis = 0; axis < 3; ++axis) low[axis] = static_cast<double>(hit.cell[axis]) * edge;
  const auto near = [&](const DagView::Cell& cell) {
    // Masks of the children in the lower half and in the upper half of each axis.
    constexpr uint32_t kHalves[3][2] = {{0x0f, 0xf0}, {0x33, 0xcc}, {0x55, 0xaa}};
    uint32_t children = 0xff;
    for (int axis = 0; axis < 3; ++axis) {
      const double middle = cell.low[axis] + cell.edge / 2;
      if (middle <= low[axis] - reach) children &= kHalves[axis][1];
      if (middle > low[axis] + reach) children &= kHalves[axis][0];
    }
    return children;
  };
  Moments m;
  dag.for_each_cell(hit.depth, near, [&](const DagView::Cell& cell) {
    const Vec d = (cell.low - low) * (1 / edge);
    const double rest = 1 - dot(d, d) / ((kReach + 0.5) * (kReach + 0.5));
    if (rest <= 0) return;
    const double w = rest * rest;
    m.weight += w;
    m.first = m.first + d * w;
    for (int i = 0; i < 3; ++i) m.second[i] = m.second[i] + d * (w * d[i]);
  });
  return m;
}

// Returns the normal of the plane that best fits the occupied cells near the hit. The normal is the
// eigenvector for the smallest eigenvalue of the covariance of these cells. If there are too few
// cells for a plane, returns the normal of the face that the ray entered.
Vec plane_normal(const DagView& dag, const Hit& hit, const Vec& direction) {
  constexpr int kIterations = 8;
  const Vec face = face_normal(hit, direction), toward_eye = face - direction;
  const Moments m = moments_around(dag, hit);
  if (m.weight < 3) return face;
  Vec c[3];
  for (int i = 0; i < 3; ++i) c[i] = m.second[i] - m.first * (m.first[i] / m.weight);
  // Normalizes the covariance and adds a small multiple of the identity matrix. Without this
  // multiple, the adjugate of a perfect plane's covariance could be zero.
  const double trace = c[0][0] + c[1][1] + c[2][2];
  for (int i = 0; i < 3; ++i) c[i] = c[i] * (1 / trace), c[i][i] += 1e-3;
  // Finds the eigenvector by inverse iteration, with the adjugate instead of the inverse matrix.
  // The two differ only by a factor.
  const Vec adjugate[3] = {cross(c[1], c[2]), cross(c[2], c[0]), cross(c[0], c[1])};
  const double scale = 1 / (adjugate[0][0] + adjugate[1][1] + adjugate[2][2]);
  Vec n = toward_eye;
  for (int i = 0; i < kIterations; ++i)
    n = Vec{{dot(adjugate[0], n), dot(adjugate[1], n), dot(adjugate[2], n)}} * scale;
  n = normalized(n);
  return dot(n, toward_eye) < 0 ? n * -1.0 : n;
}

}  // namespace

bool find_surface(const DagView& dag, const Ray& ray, double pixel_spread, SurfaceHit& s) {
  const RayCaster caster(dag);
  Hit hit;
  if (!caster.cast(ray, visible_cone(pixel_spread), 0, kFarthest, hit)) return false;
  s.t = hit.t;
  s.size = static_cast<double>(dag.resolution() >> hit.depth);
  s.depth = hit.depth;
  std::copy_n(hit.cell, 3, s.cell);
  const double pixels = s.size / std::max(s.t * pixel_spread, 1e-9);
  const double cube = std::clamp((pixels - 5) / 8, 0.0, 1.0);
  const Vec face = face_normal(hit, ray.direction);
  s.normal = cube < 1 ? normalized(mix(plane_normal(dag, hit, ray.direction), face, cube)) : face;
  // Moves the start away from the surface by more than the steps between neighboring cells of a
  // slope, so that these cells do not occlude it.
  s.start = ray.at(s.t) + s.normal * (s.size * 2.2 * (1 - cube)) + face * (s.size * 0.01);
  // In a narrow place, the start can be in an occupied cell. Then the start is replaced by the
  // point on the ray 1.5 cells before the hit. That point is free unless the camera is in an
  // occupied cell or closer than 1.5 cells to the hit.
  if (caster.occluded({s.start, s.normal}, {s.size, 0}, 0, 0)) s.start = ray.at(s.t - 1.5 * s.size);
  return true;
}

}  // namespace voxdag::query
