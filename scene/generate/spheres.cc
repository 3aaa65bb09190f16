// Spheres of many sizes in a ball. They are octahedra with n^2 triangles per face, whose vertices
// are moved out to the sphere. Larger spheres have a larger n.
#include <cmath>

#include "scene/generate/random.h"
#include "scene/generate/scene_builder.h"

namespace voxdag {
namespace {

constexpr double kBallRadius = 512;
// Number of sizes. A sphere of size s (0 to 6) has a radius from 2^s to 2^(s + 1), and the edges of
// its octahedron are divided into 2^s parts.
constexpr uint32_t kSizes = 7;

// Adds a face of the octahedron with its edges divided into n parts.
void add_face(MeshBuilder& mesh, int n, const Vec3& sign) {
  const uint32_t first = mesh.vertices();
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n - i; ++j) {
      const double x = i, y = j, z = n - i - j;
      const double length = std::sqrt(x * x + y * y + z * z);
      mesh.add_vertex({sign.x * x / length, sign.y * y / length, sign.z * z / length});
    }
  // Row i starts after rows of n + 1, n, ... vertices.
  const auto index = [&](int i, int j) {
    return first + static_cast<uint32_t>(i * (n + 1) - i * (i - 1) / 2 + j);
  };
  const bool mirrored = sign.x * sign.y * sign.z < 0;
  const auto add = [&](uint32_t a, uint32_t b, uint32_t c) {
    mirrored ? mesh.add_triangle(a, c, b) : mesh.add_triangle(a, b, c);
  };
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n - i; ++j) {
      add(index(i, j), index(i + 1, j), index(i, j + 1));
      if (j + 1 < n - i) add(index(i + 1, j), index(i + 1, j + 1), index(i, j + 1));
    }
}

MeshBuilder unit_sphere(int n) {
  MeshBuilder mesh;
  for (int face = 0; face < 8; ++face)
    add_face(mesh, n, {face & 4 ? -1.0 : 1.0, face & 2 ? -1.0 : 1.0, face & 1 ? -1.0 : 1.0});
  return mesh;
}

Vec3 point_in_ball(Random& random) {
  for (;;) {
    const double x = random.signed_unit(), y = random.signed_unit(), z = random.signed_unit();
    if (x * x + y * y + z * z <= 1) return Vec3{x, y, z} * kBallRadius;
  }
}

}  // namespace

void make_spheres(const GenerateOptions& options, SceneBuilder& scene) {
  uint32_t parts[kSizes];
  uint64_t triangles[kSizes];
  for (uint32_t size = 0; size < kSizes; ++size) {
    MeshBuilder sphere = unit_sphere(1 << size);
    triangles[size] = sphere.triangles();
    parts[size] = scene.add_part(std::move(sphere));
  }
  uint64_t made = 0;
  for (uint64_t i = 0; made < options.triangles || i == 0; ++i) {
    Random random(options.seed, {i});
    // Each size is twice as frequent as the next larger size. The largest size is drawn once in 127
    // draws.
    const uint32_t draw = random.below((1u << kSizes) - 1) + 1;
    uint32_t size = 0;
    while (draw >> (kSizes - 1 - size) == 0) ++size;
    const double radius = static_cast<double>(1 << size) * (1 + random.unit());
    scene.place(parts[size], point_in_ball(random), {radius, radius, radius});
    made += triangles[size];
  }
}

}  // namespace voxdag
