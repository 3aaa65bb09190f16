#include "tests/oracle/solid/solids.h"

#include <cmath>
#include <utility>

#include "tests/oracle/scenes.h"

namespace oracle {
namespace {

// A position in voxels.
using Place = std::array<double, 3>;

Point snapped(const Place& at) {
  Point p;
  for (int a = 0; a < 3; ++a) p[a] = 2 * static_cast<int64_t>(std::floor(128 * at[a])) + 1;
  return p;
}

void add_quad(Triangles& out, const Point& a, const Point& b, const Point& c, const Point& d) {
  out.push_back({a, b, c});
  out.push_back({a, c, d});
}

// Adds a box whose faces point outward. Bit f of `faces` selects face f: 2 * axis + (high side).
void add_box(Triangles& out, const Point& low, const Point& high, int faces = 63) {
  for (int a = 0; a < 3; ++a)
    for (int side = 0; side < 2; ++side) {
      if ((faces >> (2 * a + side) & 1) == 0) continue;
      const int b = (a + 1) % 3, c = (a + 2) % 3;
      Point p[4];
      for (int i = 0; i < 4; ++i) {
        p[i][a] = side ? high[a] : low[a];
        p[i][b] = i == 1 || i == 2 ? high[b] : low[b];
        p[i][c] = i >= 2 ? high[c] : low[c];
      }
      if (side)
        add_quad(out, p[0], p[1], p[2], p[3]);
      else
        add_quad(out, p[0], p[3], p[2], p[1]);
    }
}

// Adds a ring-shaped surface of `around` by `along` quads with the corners at(u, v), where u and v
// are from 0 to 1. at() has period 1 in u and, if `closed` is true, in v. The front faces are on
// the side of (derivative by u) x (derivative by v).
template <class At>
void add_surface(Triangles& out, int around, int along, bool closed, At at) {
  const auto point = [&](int i, int j) {
    return snapped(at(i % around / static_cast<double>(around),
                      (closed ? j % along : j) / static_cast<double>(along)));
  };
  for (int i = 0; i < around; ++i)
    for (int j = 0; j < along; ++j)
      add_quad(out, point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1));
}

constexpr double kTurn = 6.283185307179586;

void add_sphere(Triangles& out, const Place& center, double radius) {
  add_surface(out, 9, 6, false, [&](double u, double v) {
    // The poles are exact, so that the surface is closed.
    const double ring = v == 0 || v == 1 ? 0 : std::sin(kTurn / 2 * v);
    return Place{center[0] + radius * ring * std::cos(kTurn * u),
                 center[1] + radius * ring * std::sin(kTurn * u),
                 center[2] - radius * std::cos(kTurn / 2 * v)};
  });
}

void add_torus(Triangles& out, const Place& center, double radius, double tube) {
  add_surface(out, 11, 7, true, [&](double u, double v) {
    const double ring = radius + tube * std::cos(kTurn * v);
    return Place{center[0] + ring * std::cos(kTurn * u), center[1] + tube * std::sin(kTurn * v),
                 center[2] - ring * std::sin(kTurn * u)};
  });
}

void invert(Triangle& t) { std::swap(t[1], t[2]); }

void add_inverted(Triangles& out, Triangles triangles) {
  for (Triangle& t : triangles) invert(t);
  out.insert(out.end(), triangles.begin(), triangles.end());
}

// Adds a tetrahedron whose faces point outward.
void add_tetrahedron(Triangles& out, std::array<Point, 4> p) {
  int64_t volume = 0;
  for (int a = 0; a < 3; ++a) {
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    volume += (p[3][a] - p[0][a]) * ((p[1][b] - p[0][b]) * (p[2][c] - p[0][c]) -
                                     (p[1][c] - p[0][c]) * (p[2][b] - p[0][b]));
  }
  if (volume < 0) std::swap(p[1], p[2]);
  out.push_back({p[0], p[2], p[1]});
  out.push_back({p[0], p[1], p[3]});
  out.push_back({p[1], p[2], p[3]});
  out.push_back({p[2], p[0], p[3]});
}

class SolidMaker {
 public:
  SolidMaker(uint64_t seed, int edge)
      : random_(seed), edge_(edge), size_(edge * kUnits), center_(place()) {}

  void add(SolidKind kind, Triangles& out) {
    const double r = edge_ * 0.37;
    switch (kind) {
      case SolidKind::kBox:
        return add_box(out, box_low(), box_high());
      case SolidKind::kSphere:
        return add_sphere(out, center_, r);
      case SolidKind::kTorus:
        return add_torus(out, center_, 0.7 * r, 0.4 * r);
      case SolidKind::kTetrahedra:
        return add_tetrahedra(out);
      case SolidKind::kNested:
        add_sphere(out, center_, r);
        return add_inverted(out, sphere(0.5 * r));
      case SolidKind::kNestedAlike:
        add_sphere(out, center_, r);
        return add_sphere(out, center_, 0.5 * r);
      case SolidKind::kInverted:
        return add_inverted(out, sphere(r));
      case SolidKind::kDoubled:
        add_sphere(out, center_, r);
        return add_sphere(out, center_, r);
      case SolidKind::kCanceled:
        add_sphere(out, center_, r);
        return add_inverted(out, sphere(r));
      case SolidKind::kTouching:
        return add_touching(out);
      case SolidKind::kTies:
        return add_ties(out);
      case SolidKind::kHalfInverted:
        add_tetrahedra(out);
        for (size_t i = 0; i < out.size() / 2; ++i) invert(out[i]);
        return;
      case SolidKind::kOpenBox:
        return add_box(out, box_low(), box_high(), 63 & ~(1 << random_.between(0, 5)));
      case SolidKind::kHoles:
        add_sphere(out, center_, r);
        for (int i = 0; i < 4; ++i) out.erase(out.begin() + random_.between(0, 80));
        return;
      case SolidKind::kPlane:
        return add_plane(out);
      case SolidKind::kThreeWalls:
        return add_box(out, box_low(), box_high(), 0b010101);
      case SolidKind::kSoup:
        for (int i = 0; i < 12; ++i) out.push_back({point(), point(), point()});
        return;
      case SolidKind::kWithRest:
        add_torus(out, center_, 0.7 * r, 0.4 * r);
        return add_degenerate(out);
      case SolidKind::kCrossing:
        add_sphere(out, {0.1 * edge_, 0.9 * edge_, 0.4 * edge_}, r);
        return add_sphere(out, {0.5 * edge_, 0.2 * edge_, 1.1 * edge_}, 1.5 * r);
    }
  }

 private:
  // Returns a place near the center of the region.
  Place place() {
    Place at;
    for (double& x : at) x = edge_ * 0.5 + static_cast<double>(random_.between(-64, 64)) / 128;
    return at;
  }
  Point point() {
    Point p;
    for (int64_t& x : p) x = random_.odd(0, size_);
    return p;
  }
  Point box_low() {
    Point p;
    for (int64_t& x : p) x = random_.odd(size_ / 16, size_ / 4);
    return p;
  }
  Point box_high() {
    Point p;
    for (int64_t& x : p) x = random_.odd(size_ * 3 / 4, size_ * 15 / 16);
    return p;
  }
  Triangles sphere(double radius) const {
    Triangles out;
    add_sphere(out, center_, radius);
    return out;
  }

  void add_tetrahedra(Triangles& out) {
    for (int i = 0; i < 4; ++i) add_tetrahedron(out, {point(), point(), point(), point()});
  }

  void add_touching(Triangles& out) {
    const Point low = box_low(), high = box_high();
    Point middle_high = high, middle_low = low;
    middle_high[0] = middle_low[0] = random_.odd(size_ / 3, size_ * 2 / 3);
    add_box(out, low, middle_high);
    add_box(out, middle_low, high);
  }

  // Adds tetrahedra. The midpoints of two opposite edges are corners or centers of voxels, or
  // centers of voxels' faces or edges.
  void add_ties(Triangles& out) {
    for (int i = 0; i < 6; ++i) {
      std::array<Point, 4> p;
      for (int pair = 0; pair < 2; ++pair) {
        for (int a = 0; a < 3; ++a) {
          const int64_t middle = 128 * random_.between(edge_ / 2, edge_ * 3 / 2);
          const int64_t offset = tie_offset();
          p[2 * pair][a] = middle + offset;
          p[2 * pair + 1][a] = middle - offset;
        }
      }
      add_tetrahedron(out, p);
    }
  }
  // Returns size_ / 4 - 1 or its negative in half of the calls, otherwise a random odd offset. If
  // the offsets of two axes have the same absolute value, the edge has slope 1 or -1 in the plane
  // of these axes.
  int64_t tie_offset() {
    const int64_t offset = random_.coin() ? size_ / 4 - 1 : random_.odd(1, size_ / 4);
    return random_.coin() ? offset : -offset;
  }

  void add_plane(Triangles& out) {
    const auto height = [&] { return random_.odd(size_ / 3, size_ * 2 / 3); };
    const int64_t a = -5 * kUnits + 1, b = size_ + 5 * kUnits + 1;
    const Point p[3] = {{a, a, height()}, {b, a, height()}, {b, b, height()}};
    add_quad(out, p[0], p[1], p[2], {a, b, p[0][2] + p[2][2] - p[1][2]});
  }

  void add_degenerate(Triangles& out) {
    for (int i = 0; i < 5; ++i) {
      const Point p = point(), q = point();
      Point middle;
      for (int a = 0; a < 3; ++a) middle[a] = p[a] + 3 * (q[a] - p[a]);
      out.push_back({p, p, p});
      out.push_back({p, q, p});
      out.push_back({p, q, middle});
    }
  }

  Random random_;
  int edge_;
  int64_t size_;
  Place center_;
};

}  // namespace

std::string kind_name(SolidKind kind) {
  static const char* const kNames[] = {"box",      "sphere",       "torus",    "tetrahedra",
                                       "nested",   "nested_alike", "inverted", "doubled",
                                       "canceled", "touching",     "ties",     "one_inverted",
                                       "open_box", "holes",        "plane",    "three_walls",
                                       "soup",     "with_rest",    "crossing"};
  return kNames[static_cast<int>(kind)];
}

Triangles make_solid(SolidKind kind, uint64_t seed, int edge) {
  Triangles out;
  SolidMaker(seed, edge).add(kind, out);
  return out;
}

}  // namespace oracle
