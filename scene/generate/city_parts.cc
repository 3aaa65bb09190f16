#include <array>
#include <utility>

#include "scene/generate/city.h"

namespace voxdag {
namespace {

constexpr Rgba8 kGlass{40, 62, 92, 255}, kTrunk{205, 51, 100, 255}, kLeaves{200, 225, 160, 255};

// A unit of wall with a window whose pane is set back behind the wall's plane. It has 12 corners in
// three rings (the wall's edge, the window in the wall, the pane) and 18 triangles.
//
//     +-----------+        u to the right, v up, w out of the wall
//     | \_______/ |
//     |  |     |  |
//     |  |_____|  |
//     | /       \ |
//     +-----------+
MeshBuilder window_wall(const Vec3& u, const Vec3& w) {
  constexpr double kLeft = 0.1875, kRight = 0.8125, kSill = 0.25, kLintel = 0.875;
  constexpr double kRings[3][4] = {
      {0, 1, 0, 1}, {kLeft, kRight, kSill, kLintel}, {kLeft, kRight, kSill, kLintel}};
  MeshBuilder mesh;
  for (int ring = 0; ring < 3; ++ring) {
    const auto& [left, right, bottom, top] = kRings[ring];
    mesh.color = ring == 2 ? kGlass : kWhite;
    const Vec3 depth = w * (ring == 2 ? -1.0 : 0.0);
    for (const auto& [across, up] : {std::pair(left, bottom), std::pair(right, bottom),
                                     std::pair(right, top), std::pair(left, top)})
      mesh.add_vertex(u * across + Vec3{0, up, 0} + depth);
  }
  for (uint32_t ring = 0; ring < 2; ++ring)
    for (uint32_t corner = 0; corner < 4; ++corner) {
      const uint32_t a = 4 * ring + corner, b = 4 * ring + (corner + 1) % 4;
      mesh.add_triangle(a, b, b + 4);
      mesh.add_triangle(a, b + 4, a + 4);
    }
  mesh.add_triangle(8, 9, 10);
  mesh.add_triangle(8, 10, 11);
  return mesh;
}

// Returns a tree: a trunk and two crowns. Each crown consists of two pyramids that share their
// base.
MeshBuilder tree_mesh() {
  MeshBuilder mesh;
  mesh.color = kTrunk;
  mesh.box({-0.03125, 0, -0.03125}, {0.03125, 0.3125, 0.03125}, false);
  mesh.color = kLeaves;
  for (const auto& [low, middle, high, radius] :
       {std::array{0.1875, 0.375, 0.75, 0.25}, std::array{0.46875, 0.5625, 1.0, 0.1875}}) {
    const uint32_t first = mesh.add_vertices({{radius, middle, 0},
                                              {0, middle, radius},
                                              {-radius, middle, 0},
                                              {0, middle, -radius},
                                              {0, low, 0},
                                              {0, high, 0}});
    for (uint32_t side = 0; side < 4; ++side) {
      const uint32_t a = first + side, b = first + (side + 1) % 4;
      mesh.add_triangle(b, a, first + 5);
      mesh.add_triangle(a, b, first + 4);
    }
  }
  return mesh;
}

MeshBuilder car_mesh(bool along_z) {
  MeshBuilder mesh;
  const auto box = [&](double length_from, double length_to, double half_width, double y0,
                       double y1) {
    along_z ? mesh.box({-half_width, y0, length_from}, {half_width, y1, length_to})
            : mesh.box({length_from, y0, -half_width}, {length_to, y1, half_width});
  };
  mesh.color = kWhite;
  box(-2.125, 2.125, 0.875, 0.25, 0.875);
  mesh.color = kGlass;
  box(-1.25, 0.875, 0.75, 0.875, 1.5);
  return mesh;
}

}  // namespace

CityParts::CityParts(SceneBuilder& scene) {
  const Vec3 x{1, 0, 0}, z{0, 0, 1}, minus_x{-1, 0, 0}, minus_z{0, 0, -1};
  window[0] = scene.add_part(window_wall(x, z));
  window[1] = scene.add_part(window_wall(minus_z, x));
  window[2] = scene.add_part(window_wall(minus_x, minus_z));
  window[3] = scene.add_part(window_wall(z, minus_x));
  tree = scene.add_part(tree_mesh());
  car[0] = scene.add_part(car_mesh(false));
  car[1] = scene.add_part(car_mesh(true));
}

}  // namespace voxdag
