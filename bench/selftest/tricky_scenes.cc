#include <algorithm>
#include <functional>
#include <random>

#include "bench/selftest/scenes.h"

namespace voxdag::selftest {
namespace {

// Makes single triangles in and around a cube.
class Maker {
 public:
  Maker(uint64_t seed, const Cube& cube, uint32_t grid_levels) : random_(seed) {
    edge_ = cube.edge_voxels(grid_levels) * kUnitsPerVoxel;
    for (int a = 0; a < 3; ++a) low_[a] = cube.position[a] * edge_;
  }

  // Returns a triangle around a random point of the cube. Each coordinate of its vertices is within
  // `reach` units of the point's coordinate.
  FixedTriangle near(int64_t reach) {
    FixedTriangle t;
    for (int a = 0; a < 3; ++a) {
      const int64_t at = low_[a] + between(0, edge_ - 1);
      for (auto& v : t.v) v[a] = odd(at + between(-reach, reach));
    }
    return t;
  }
  FixedTriangle any() { return near(edge_ >> between(0, 8)); }
  FixedTriangle degenerate() {
    FixedTriangle t = any();
    if (coin()) std::copy_n(t.v[0], 3, t.v[1]);
    if (coin()) std::copy_n(t.v[0], 3, t.v[2]);
    for (int a = 0; a < 3; ++a)
      if (between(0, 2) == 0) t.v[2][a] = t.v[1][a] = t.v[0][a];
    return t;
  }
  FixedTriangle sliver() {
    FixedTriangle t = near(edge_);
    for (int a = 0; a < 3; ++a) t.v[2][a] = t.v[between(0, 1)][a] + 2 * between(-2, 2);
    return t;
  }
  FixedTriangle small() { return near(kUnitsPerVoxel / 2); }
  FixedTriangle wall() {
    FixedTriangle t = near(edge_);
    const int64_t axis = between(0, 2);
    for (auto& v : t.v) v[axis] = t.v[0][axis];
    return t;
  }
  // Returns a triangle whose vertices are corners of voxels, moved along each axis by 1 or -1 unit,
  // because coordinates must be odd. All three vertices are moved by the same vector. So planes and
  // edges of 45 degrees touch voxels exactly at their corners.
  FixedTriangle diagonal() {
    FixedTriangle t;
    for (int a = 0; a < 3; ++a) {
      const int64_t by = coin() ? 1 : -1;
      for (auto& v : t.v) v[a] = low_[a] + between(0, edge_ / kUnitsPerVoxel) * kUnitsPerVoxel + by;
    }
    const int64_t axis = between(0, 2), run = t.v[1][axis] - t.v[0][axis];
    t.v[1][(axis + 1) % 3] = t.v[0][(axis + 1) % 3] + (coin() ? run : -run);
    t.v[2][axis] = t.v[0][axis];
    t.v[2][(axis + 1) % 3] = t.v[0][(axis + 1) % 3];
    return t;
  }
  FixedTriangle spanning() { return near(2 * edge_); }
  FixedTriangle wide() {
    FixedTriangle t = any();
    const int64_t vertex = between(0, 2);
    for (int a = 0; a < 3; ++a)
      t.v[vertex][a] = odd(between(1 - kCoordinateLimit, kCoordinateLimit - 2));
    return t;
  }

 private:
  int64_t between(int64_t low, int64_t high) {
    return low + static_cast<int64_t>(random_() % static_cast<uint64_t>(high - low + 1));
  }
  bool coin() { return between(0, 1) == 1; }
  static int64_t odd(int64_t x) { return x | 1; }

  std::mt19937_64 random_;
  int64_t edge_, low_[3];
};

}  // namespace

std::vector<Scene> tricky_scenes(uint64_t seed, const Cube& cube, uint32_t grid_levels, int count) {
  Maker maker(seed, cube, grid_levels);
  const std::pair<const char*, FixedTriangle (Maker::*)()> kinds[] = {
      {"soup", &Maker::any},          {"degenerate", &Maker::degenerate},
      {"slivers", &Maker::sliver},    {"sub-voxel", &Maker::small},
      {"walls", &Maker::wall},        {"diagonal", &Maker::diagonal},
      {"spanning", &Maker::spanning}, {"wide", &Maker::wide}};
  std::vector<Scene> scenes;
  Scene mixed{"mixed", {}};
  for (const auto& [name, make] : kinds) {
    Scene& scene = scenes.emplace_back(Scene{name, {}});
    for (int i = 0; i < count; ++i) scene.triangles.push_back((maker.*make)());
    mixed.triangles.insert(mixed.triangles.end(), scene.triangles.begin(),
                           scene.triangles.begin() + count / 4);
  }
  scenes.push_back(std::move(mixed));
  return scenes;
}

}  // namespace voxdag::selftest
