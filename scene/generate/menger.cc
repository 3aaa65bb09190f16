// Menger's sponge of level n: a grid of 3^n unit cells per axis, without the cells that at some
// scale are in the middle of two or three axes. Every face between a remaining cell and a removed
// cell or the outside is a unit square with corners on the integer lattice. The sponge has 2*20^n +
// 4*8^n such squares.
#include "scene/generate/scene_builder.h"

namespace voxdag {
namespace {

class Menger {
 public:
  Menger(uint32_t level, SceneBuilder& scene) : scene_(scene) {
    for (uint32_t i = 0; i < level; ++i) size_ *= 3;
  }

  void make() { cut({0, 0, 0}, size_); }

 private:
  struct Cell {
    int x, y, z;
  };

  bool solid(Cell c) const {
    for (int v : {c.x, c.y, c.z})
      if (v < 0 || v >= size_) return false;
    for (int scale = size_ / 3; scale > 0; scale /= 3)
      if ((c.x / scale % 3 == 1) + (c.y / scale % 3 == 1) + (c.z / scale % 3 == 1) >= 2)
        return false;
    return true;
  }

  void cut(Cell low, int size) {
    if (size == 1) return faces(low);
    const int third = size / 3;
    for (int i = 0; i < 27; ++i) {
      const int x = i / 9, y = i / 3 % 3, z = i % 3;
      if ((x == 1) + (y == 1) + (z == 1) < 2)
        cut({low.x + x * third, low.y + y * third, low.z + z * third}, third);
    }
  }

  void faces(Cell c) {
    if (!solid({c.x - 1, c.y, c.z})) face(c, {0, 0, 0}, {0, 0, 1}, {0, 1, 0});
    if (!solid({c.x + 1, c.y, c.z})) face(c, {1, 0, 0}, {0, 1, 0}, {0, 0, 1});
    if (!solid({c.x, c.y - 1, c.z})) face(c, {0, 0, 0}, {1, 0, 0}, {0, 0, 1});
    if (!solid({c.x, c.y + 1, c.z})) face(c, {0, 1, 0}, {0, 0, 1}, {1, 0, 0});
    if (!solid({c.x, c.y, c.z - 1})) face(c, {0, 0, 0}, {0, 1, 0}, {1, 0, 0});
    if (!solid({c.x, c.y, c.z + 1})) face(c, {0, 0, 1}, {1, 0, 0}, {0, 1, 0});
  }

  void face(Cell c, const Vec3& corner, const Vec3& u, const Vec3& v) {
    const Vec3 p =
        corner + Vec3{static_cast<double>(c.x), static_cast<double>(c.y), static_cast<double>(c.z)};
    scene_.mesh_for(4, 2).quad(p, p + u, p + u + v, p + v);
  }

  SceneBuilder& scene_;
  int size_ = 1;
};

}  // namespace

void make_menger(const GenerateOptions& options, SceneBuilder& scene) {
  Menger(options.level, scene).make();
}

}  // namespace voxdag
