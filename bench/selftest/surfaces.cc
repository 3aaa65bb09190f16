#include <cmath>
#include <functional>

#include "bench/selftest/scenes.h"

namespace voxdag::selftest {
namespace {

constexpr double kPi = 3.14159265358979323846;

struct Point {
  double x, y, z;  // the grid is [0, 1]^3
};

// Adds surfaces to a scene. Each surface becomes a mesh of columns x rows quads of two triangles.
class SurfaceMesher {
 public:
  SurfaceMesher(Scene& scene, uint32_t grid_levels)
      : scene_(scene), scale_(128 * std::ldexp(1.0, static_cast<int>(grid_levels))) {}

  // `at` maps the square [0, 1]^2 to points of the surface.
  void add(uint64_t columns, uint64_t rows, const std::function<Point(double, double)>& at) {
    const auto point = [&](uint64_t c, uint64_t r) {
      return at(static_cast<double>(c) / static_cast<double>(columns),
                static_cast<double>(r) / static_cast<double>(rows));
    };
    for (uint64_t c = 0; c < columns; ++c)
      for (uint64_t r = 0; r < rows; ++r) {
        const Point corners[4] = {point(c, r), point(c + 1, r), point(c, r + 1),
                                  point(c + 1, r + 1)};
        add(corners[0], corners[1], corners[2]);
        add(corners[3], corners[2], corners[1]);
      }
  }

 private:
  void add(const Point& a, const Point& b, const Point& c) {
    FixedTriangle t;
    int i = 0;
    for (const Point* p : {&a, &b, &c}) {
      const double xyz[3] = {p->x, p->y, p->z};
      for (int axis = 0; axis < 3; ++axis)
        t.v[i][axis] = 2 * static_cast<int64_t>(std::floor(xyz[axis] * scale_)) + 1;
      ++i;
    }
    scene_.triangles.push_back(t);
  }

  Scene& scene_;
  const double scale_;
};

}  // namespace

Scene scan(uint64_t triangles, uint32_t grid_levels) {
  Scene scene{"scan", {}};
  const auto rows = static_cast<uint64_t>(std::sqrt(static_cast<double>(triangles) / 4)) + 1;
  SurfaceMesher(scene, grid_levels).add(2 * rows, rows, [](double u, double v) {
    const double lon = 2 * kPi * u, lat = kPi * v;
    const double bumps = 0.03 * std::sin(9 * lon) * std::sin(7 * lat) +
                         0.01 * std::sin(31 * lon + 3 * lat) * std::sin(29 * lat) +
                         0.003 * std::sin(101 * lat + 5 * lon) * std::sin(83 * lon) * std::sin(lat);
    const double radius = 0.45 + bumps * std::sin(lat);
    return Point{0.5 + radius * std::sin(lat) * std::cos(lon),
                 0.5 + radius * std::sin(lat) * std::sin(lon), 0.5 + radius * std::cos(lat)};
  });
  return scene;
}

Scene building(uint64_t triangles, uint32_t grid_levels) {
  Scene scene{"building", {}};
  SurfaceMesher mesh(scene, grid_levels);
  constexpr int kFloors = 3, kColumns = 24;
  const auto fine =
      static_cast<uint64_t>(std::sqrt(static_cast<double>(triangles) / (4 * kFloors * kColumns)));
  for (int floor = 0; floor < kFloors; ++floor) {
    const double y = 0.05 + 0.3 * floor, height = 0.28;
    mesh.add(2, 2, [=](double u, double v) { return Point{u, y, 0.2 + 0.6 * v}; });
    for (const double z : {0.2, 0.8})
      mesh.add(6, 1, [=](double u, double v) { return Point{u, y + height * v, z}; });
    for (int i = 0; i < kColumns; ++i) {
      const double x = (i / 2 + 0.5) / (kColumns / 2), z = i % 2 ? 0.35 : 0.65;
      mesh.add(fine, fine + 1, [=](double u, double v) {
        const double radius = 0.008 + 0.004 * std::pow(2 * v - 1, 8);
        return Point{x + radius * std::cos(2 * kPi * u), y + height * v,
                     z + radius * std::sin(2 * kPi * u)};
      });
      mesh.add(fine, fine + 1, [=](double u, double v) {
        return Point{x - 0.03 + 0.06 * u, y + height * (0.3 + 0.6 * v),
                     z + 0.012 * std::sin(9 * kPi * u) * (1 - 0.5 * v) + 0.02};
      });
    }
  }
  return scene;
}

}  // namespace voxdag::selftest
