#include "tests/oracle/scenes.h"

#include <algorithm>

namespace oracle {
namespace {

// Makes triangles one by one, around one region.
class Maker {
 public:
  Maker(uint64_t seed, const Region& region)
      : random_(seed), size_(region.edge * kUnits), voxels_(region.edge) {
    for (int a = 0; a < 3; ++a) low_[a] = region.low[a] * kUnits;
  }

  void add(SceneKind kind, Triangles& out) {
    switch (kind) {
      case SceneKind::kSoup:
        return out.push_back(near(point(), some_size()));
      case SceneKind::kDegenerate:
        return out.push_back(degenerate());
      case SceneKind::kSliver:
        return out.push_back(sliver());
      case SceneKind::kSubVoxel:
        return out.push_back(near(point(), random_.between(2, 200)));
      case SceneKind::kWalls:
        return wall(out);
      case SceneKind::kDiagonal:
        return out.push_back(diagonal());
      case SceneKind::kSpanning:
        return out.push_back({side(), side(), side()});
      case SceneKind::kCoincident:
        return coincident(out);
      case SceneKind::kThroughCorners:
        return out.push_back(through_corner());
      case SceneKind::kCrossing:
        return out.push_back(crossing());
      case SceneKind::kWide:
        return out.push_back(wide());
    }
  }

 private:
  // Returns a point inside the region.
  Point point() {
    Point p;
    for (int a = 0; a < 3; ++a) p[a] = low_[a] + random_.odd(0, size_);
    return p;
  }
  // Returns a point within `reach` of p on every axis.
  Point around(const Point& p, int64_t reach) {
    Point q;
    for (int a = 0; a < 3; ++a) q[a] = random_.odd(p[a] - reach, p[a] + reach);
    return q;
  }
  Triangle near(const Point& p, int64_t reach) {
    return {around(p, reach), around(p, reach), around(p, reach)};
  }
  // Returns a size from half a voxel to the complete region: halves the region's edge repeatedly,
  // with a probability of 2/3 for each further step.
  int64_t some_size() {
    int64_t size = size_;
    while (size > 128 && random_.between(0, 2) != 0) size /= 2;
    return size;
  }

  Triangle degenerate() {
    const Point p = point(), q = random_.coin() ? point() : around(p, 600);
    Point r = q;
    switch (random_.between(0, 4)) {
      case 0:
        return {p, p, p};
      case 1:
        return {p, q, p};
      case 2:
        return {p, q, q};
      case 3:  // along an axis
        r = p;
        r[random_.between(0, 2)] += 2 * random_.between(-size_ / 4, size_ / 4);
        return {p, r, p};
      default:  // three different vertices on a line
        for (int a = 0; a < 3; ++a) r[a] = p[a] + 3 * (q[a] - p[a]);
        return {p, r, q};
    }
  }

  Triangle sliver() {
    const Point p = point(), q = point();
    Point r = random_.coin() ? p : q;
    r[random_.between(0, 2)] += random_.coin() ? 2 : -2;
    return {p, q, r};
  }

  // Adds a rectangle at a fixed x, y or z, as two triangles.
  void wall(Triangles& out) {
    const int64_t axis = random_.between(0, 2), other = (axis + random_.between(1, 2)) % 3;
    const Point p = point();
    Point r = point();
    r[axis] = p[axis];
    Point q = p, s = r;
    q[other] = r[other];
    s[other] = p[other];
    out.push_back({p, q, r});
    out.push_back({r, s, p});
  }

  // Returns a triangle in a plane a + b = 256 k or a - b = 256 k, for two axes a and b. The plane
  // contains edges of voxels. Of the four voxels at such an edge, it cuts two and touches the other
  // two only at the edge.
  Triangle diagonal() {
    const int64_t a = random_.between(0, 2), b = (a + random_.between(1, 2)) % 3;
    const int64_t sign = random_.coin() ? 1 : -1;
    const int64_t plane = kUnits * random_.between(-voxels_, 2 * voxels_);
    Triangle t;
    for (Point& p : t) {
      p = point();
      p[b] = low_[b] + sign * (low_[a] + plane - p[a]);
    }
    return t;
  }

  // Returns a point on the surface of the region.
  Point side() {
    Point p = point();
    const int64_t axis = random_.between(0, 2);
    p[axis] = random_.coin() ? low_[axis] + 1 : low_[axis] + size_ - 1;
    return p;
  }

  void coincident(Triangles& out) {
    const Triangle t = near(point(), some_size());
    out.push_back(t);
    out.push_back({t[1], t[2], t[0]});
    out.push_back({t[2], t[1], t[0]});
  }

  // Returns a triangle whose first edge has a voxel's corner as its midpoint.
  Triangle through_corner() {
    const Point corner = near_corner(point());
    const int64_t reach = std::max<int64_t>(some_size() / 2, 3);
    Point d, p, q;
    for (int a = 0; a < 3; ++a) {
      d[a] = random_.odd(-reach, reach);
      p[a] = corner[a] + d[a];
      q[a] = corner[a] - d[a];
    }
    return {p, q, random_.coin() ? p : around(corner, reach)};
  }
  static Point near_corner(Point p) {
    for (int64_t& u : p) u -= u & (kUnits - 1);
    return p;
  }

  Triangle crossing() {
    Triangle t;
    for (Point& p : t)
      for (int a = 0; a < 3; ++a) p[a] = low_[a] + random_.odd(-size_, 2 * size_);
    return t;
  }

  // Returns a triangle with two far vertices on opposite sides of a point of the region. The third
  // vertex is anywhere.
  Triangle wide() {
    const Point middle = point();
    Point p, q, r;
    for (int a = 0; a < 3; ++a) {
      const int64_t reach = random_.coin() ? kWidest - std::abs(middle[a]) : 64 * size_;
      const int64_t d = 2 * random_.between(-reach / 2, reach / 2);
      p[a] = middle[a] + d;
      q[a] = middle[a] - d;
      r[a] = random_.odd(-kWidest, kWidest);
    }
    if (random_.coin()) r = middle;
    return {p, q, r};
  }

  Random random_;
  const int64_t size_;  // edge of the region, in lattice units
  const int64_t voxels_;
  Point low_;
};

}  // namespace

std::string kind_name(SceneKind kind) {
  switch (kind) {
    case SceneKind::kSoup:
      return "soup";
    case SceneKind::kDegenerate:
      return "degenerate";
    case SceneKind::kSliver:
      return "sliver";
    case SceneKind::kSubVoxel:
      return "sub_voxel";
    case SceneKind::kWalls:
      return "walls";
    case SceneKind::kDiagonal:
      return "diagonal";
    case SceneKind::kSpanning:
      return "spanning";
    case SceneKind::kCoincident:
      return "coincident";
    case SceneKind::kThroughCorners:
      return "through_corners";
    case SceneKind::kCrossing:
      return "crossing";
    case SceneKind::kWide:
      return "wide";
  }
  return "";
}

Triangles make_scene(SceneKind kind, uint64_t seed, const Region& region, int count) {
  Maker maker(seed * 16 + static_cast<uint64_t>(kind), region);
  Triangles triangles;
  while (triangles.size() < static_cast<size_t>(count)) maker.add(kind, triangles);
  return triangles;
}

}  // namespace oracle
