// Random triangles in a cube. They include cases that are rare in models but that a builder must
// process without errors. The numbers of each kind in 1000 triangles are about:
//     680  ordinary: their size is from 1/16 to 1/16384 of the cube's edge; all powers of 2 in this
//          range are equally likely
//     160  slivers: two corners far apart, the third close to one of them or to their edge
//      79  in an axis-aligned plane
//       1  as large as the cube
//      80  degenerate: a point, a segment with a double corner, three corners in line
#include "scene/generate/random.h"
#include "scene/generate/scene_builder.h"

namespace voxdag {
namespace {

constexpr double kHalfEdge = 512;

struct Corners {
  Vec3 a, b, c;
};

Vec3 random_vector(Random& random, double size) {
  const double x = random.signed_unit(), y = random.signed_unit(), z = random.signed_unit();
  return Vec3{x, y, z} * size;
}

Vec3 random_place(Random& random) { return random_vector(random, kHalfEdge * 0.75); }

double random_size(Random& random) {
  return kHalfEdge * 0.0625 / static_cast<double>(1u << random.below(11));
}

Corners ordinary(Random& random) {
  const Vec3 place = random_place(random);
  const double size = random_size(random);
  const Vec3 a = random_vector(random, size), b = random_vector(random, size);
  return {place + a, place + b, place + random_vector(random, size)};
}

Corners sliver(Random& random) {
  const Vec3 a = random_place(random);
  const Vec3 b = a + random_vector(random, kHalfEdge * 0.25);
  const double along = random.chance(50) ? 0 : random.unit();
  return {a, b, a + (b - a) * along + random_vector(random, 0x1p-8)};
}

Corners aligned(Random& random) {
  Corners t = ordinary(random);
  switch (random.below(3)) {
    case 0:
      t.b.x = t.c.x = t.a.x;
      break;
    case 1:
      t.b.y = t.c.y = t.a.y;
      break;
    default:
      t.b.z = t.c.z = t.a.z;
  }
  return t;
}

Corners spanning(Random& random) {
  const Vec3 a = random_vector(random, kHalfEdge), b = random_vector(random, kHalfEdge);
  return {a, b, random_vector(random, kHalfEdge)};
}

Corners degenerate(Random& random) {
  const Vec3 a = random_place(random);
  const Vec3 step = random_vector(random, random_size(random) * 0.5);
  switch (random.below(3)) {
    case 0:
      return {a, a, a};
    case 1:
      return {a, a + step, a};
    default:
      return {a, a + step, a + step * 2};
  }
}

Corners random_triangle(Random& random) {
  const uint32_t draw = random.below(1000);
  if (draw < 680) return ordinary(random);
  if (draw < 840) return sliver(random);
  if (draw < 919) return aligned(random);
  if (draw < 920) return spanning(random);
  return degenerate(random);
}

}  // namespace

void make_soup(const GenerateOptions& options, SceneBuilder& scene) {
  for (uint64_t i = 0; i < options.triangles; ++i) {
    Random random(options.seed, {i});
    const Corners t = random_triangle(random);
    scene.mesh_for(3, 1).triangle(t.a, t.b, t.c);
  }
}

}  // namespace voxdag
