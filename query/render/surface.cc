#include "query/render/surface.h"

#include <algorithm>
#include <bit>

namespace voxdag::query {
namespace {

constexpr int64_t kReach = 3;  // cells on each side

struct Matrix {
  double m[3][3];
};

// Weighted sums over the occupied cells of the hit cell's size around it.
class Neighborhood {
 public:
  Neighborhood(const DagView& dag, const Hit& hit) : dag_(dag), hit_(hit) {
    visit(0, 0, 0, 0, dag.root());
  }

  double weight() const { return weight_; }

  // Weighted covariance, up to a factor.
  Matrix covariance() const {
    Matrix c;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) c.m[i][j] = second_[i][j] - first_[i] * first_[j] / weight_;
    return c;
  }

 private:
  void visit(uint32_t depth, int64_t x, int64_t y, int64_t z, uint64_t content) {
    if (depth == hit_.depth) return add(x, y, z);
    // Child indices of the low and the high half of each axis.
    constexpr uint32_t kHalves[3][2] = {{0x0f, 0xf0}, {0x33, 0xcc}, {0x55, 0xaa}};
    const DagView::Children children = dag_.children(depth, content);
    const int64_t low[3] = {2 * x, 2 * y, 2 * z};
    uint32_t wanted = children.mask;
    for (int axis = 0; axis < 3; ++axis)
      for (int half = 0; half < 2; ++half)
        if (!near(depth + 1, axis, low[axis] + half)) wanted &= ~kHalves[axis][half];
    for (; wanted != 0; wanted &= wanted - 1) {
      const int i = std::countr_zero(wanted);
      visit(depth + 1, low[0] + (i >> 2), low[1] + (i >> 1 & 1), low[2] + (i & 1),
            dag_.content(depth, children, i));
    }
  }

  // Whether cell position `c` at `depth` covers any cell within reach.
  bool near(uint32_t depth, int axis, int64_t c) const {
    const uint32_t shift = hit_.depth - depth;
    return c >= (hit_.cell[axis] - kReach) >> shift && c <= (hit_.cell[axis] + kReach) >> shift;
  }

  void add(int64_t x, int64_t y, int64_t z) {
    const double d[3] = {static_cast<double>(x - hit_.cell[0]),
                         static_cast<double>(y - hit_.cell[1]),
                         static_cast<double>(z - hit_.cell[2])};
    constexpr double kEnd = (kReach + 0.5) * (kReach + 0.5);
    const double rest = 1 - (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) / kEnd;
    if (rest <= 0) return;
    const double w = rest * rest;
    weight_ += w;
    for (int i = 0; i < 3; ++i) {
      first_[i] += w * d[i];
      for (int j = 0; j < 3; ++j) second_[i][j] += w * d[i] * d[j];
    }
  }

  const DagView& dag_;
  const Hit& hit_;
  double weight_ = 0;
  double first_[3] = {};
  double second_[3][3] = {};
};

// Largest where the matrix is smallest: its adjugate has the same eigenvectors, and products of the
// two other eigenvalues.
Matrix adjugate(const Matrix& a) {
  Matrix r;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      r.m[i][j] = a.m[j1][i1] * a.m[j2][i2] - a.m[j1][i2] * a.m[j2][i1];
    }
  return r;
}

// Squared and scaled to trace 1; repeated, it becomes the projection on the main eigenvector.
Matrix squared(const Matrix& a) {
  Matrix r;
  double trace = 0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      r.m[i][j] = 0;
      for (int k = 0; k < 3; ++k) r.m[i][j] += a.m[i][k] * a.m[k][j];
      if (i == j) trace += r.m[i][j];
    }
  for (auto& row : r.m)
    for (double& value : row) value /= trace;
  return r;
}

// The eigenvector of the smallest eigenvalue; false if the cells lie on a line.
bool thinnest_direction(Matrix covariance, Vec& direction) {
  const double trace = covariance.m[0][0] + covariance.m[1][1] + covariance.m[2][2];
  if (!(trace > 0)) return false;
  // Keeps a perfect plane, of eigenvalue 0, from making the adjugate of a line vanish.
  for (int i = 0; i < 3; ++i) covariance.m[i][i] += 1e-3 * trace;
  Matrix p = adjugate(covariance);
  for (int i = 0; i < 5; ++i) p = squared(p);
  int best = 0;
  for (int i = 1; i < 3; ++i)
    if (p.m[i][i] > p.m[best][best]) best = i;
  if (p.m[best][best] < 1.0 / 3) return false;
  direction = normalized({{p.m[0][best], p.m[1][best], p.m[2][best]}});
  return true;
}

}  // namespace

Vec face_normal(const Hit& hit, const Vec& direction) {
  if (hit.axis < 0) return direction * -1.0;
  Vec normal;
  normal[hit.axis] = direction[hit.axis] > 0 ? -1 : 1;
  return normal;
}

Vec plane_normal(const DagView& dag, const Hit& hit, const Vec& direction) {
  const Vec face = face_normal(hit, direction);
  const Neighborhood cells(dag, hit);
  Vec normal;
  if (cells.weight() < 3 || !thinnest_direction(cells.covariance(), normal)) return face;
  return dot(normal, face - direction) < 0 ? normal * -1.0 : normal;
}

bool find_surface(const DagView& dag, const Ray& ray, double pixel_spread, Surface& s) {
  constexpr double kFar = 1e30;
  const RayCaster caster(dag);
  Hit hit;
  if (!caster.cast(ray, {0, 0.75 * pixel_spread}, 0, kFar, hit)) return false;
  s.t = hit.t;
  s.size = static_cast<double>(dag.resolution() >> hit.depth);
  const double pixels = s.size / std::max(s.t * pixel_spread, 1e-9);
  const double cube = std::clamp((pixels - 5) / 8, 0.0, 1.0);
  const Vec face = face_normal(hit, ray.direction);
  s.normal = cube < 1 ? normalized(mix(plane_normal(dag, hit, ray.direction), face, cube)) : face;
  // Beyond the steps that cells make of a slope.
  s.start = ray.at(s.t) + s.normal * (s.size * 2.2 * (1 - cube)) + face * (s.size * 0.01);
  // In a narrow place that may lie in something else; where the ray came through is free.
  if (caster.cast({s.start, s.normal}, {s.size, 0}, 0, 0, hit))
    s.start = ray.at(s.t - 1.5 * s.size);
  return true;
}

}  // namespace voxdag::query
