#include "scene/generate/mesh_builder.h"

#include <span>

namespace voxdag {
namespace {

// The corner index of a box is 4x + 2y + z, with 0 for the low side. The corners of a face are
// counter-clockwise as seen from outside. The bottom is the last face.
constexpr uint8_t kBoxFaces[6][4] = {{0, 1, 3, 2}, {5, 4, 6, 7}, {4, 0, 2, 6},
                                     {1, 5, 7, 3}, {3, 7, 6, 2}, {0, 4, 5, 1}};

void add_box_faces(MeshBuilder& mesh, uint32_t first, bool bottom) {
  for (const auto& f : std::span(kBoxFaces).first(bottom ? 6 : 5)) {
    mesh.add_triangle(first + f[0], first + f[1], first + f[2]);
    mesh.add_triangle(first + f[0], first + f[2], first + f[3]);
  }
}

Vec3 turned(const Vec3& center, double x, double y, double z, const Turn& turn) {
  return {center.x + (turn.cosine * x + turn.sine * z), center.y + y,
          center.z + (turn.cosine * z - turn.sine * x)};
}

}  // namespace

Turn pythagorean_turn(uint32_t choice) {
  static constexpr double kTriples[6][3] = {{0, 1, 1},    {3, 4, 5},   {5, 12, 13},
                                            {20, 21, 29}, {8, 15, 17}, {7, 24, 25}};
  const auto& triple = kTriples[choice % 6];
  const bool swapped = choice / 6 % 2 != 0;
  return {triple[swapped ? 0 : 1] / triple[2], triple[swapped ? 1 : 0] / triple[2]};
}

uint32_t MeshBuilder::add_vertices(std::initializer_list<Vec3> corners) {
  const uint32_t first = vertices();
  for (const Vec3& p : corners) add_vertex(p);
  return first;
}

void MeshBuilder::add_triangle(uint32_t a, uint32_t b, uint32_t c) {
  for (uint32_t i : {a, b, c}) indices.push_back(static_cast<uint16_t>(i));
}

void MeshBuilder::triangle(const Vec3& a, const Vec3& b, const Vec3& c) {
  const uint32_t first = add_vertices({a, b, c});
  add_triangle(first, first + 1, first + 2);
}

void MeshBuilder::quad(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  const uint32_t first = add_vertices({a, b, c, d});
  add_triangle(first, first + 1, first + 2);
  add_triangle(first, first + 2, first + 3);
}

void MeshBuilder::box(const Vec3& low, const Vec3& high, bool bottom) {
  const uint32_t first = vertices();
  for (int i = 0; i < 8; ++i)
    add_vertex({i & 4 ? high.x : low.x, i & 2 ? high.y : low.y, i & 1 ? high.z : low.z});
  add_box_faces(*this, first, bottom);
}

void MeshBuilder::turned_box(const Vec3& base, const Vec3& half_and_height, const Turn& turn) {
  const uint32_t first = vertices();
  const Vec3& h = half_and_height;
  for (int i = 0; i < 8; ++i)
    add_vertex(turned(base, i & 4 ? h.x : -h.x, i & 2 ? h.y : 0, i & 1 ? h.z : -h.z, turn));
  add_box_faces(*this, first, false);
}

void MeshBuilder::pyramid(const Vec3& base, const Vec3& half_and_height, const Turn& turn) {
  const Vec3& h = half_and_height;
  const uint32_t first = add_vertices({turned(base, -h.x, 0, -h.z, turn),
                                       turned(base, -h.x, 0, h.z, turn),
                                       turned(base, h.x, 0, h.z, turn),
                                       turned(base, h.x, 0, -h.z, turn),
                                       {base.x, base.y + h.y, base.z}});
  for (uint32_t side = 0; side < 4; ++side)
    add_triangle(first + side, first + (side + 1) % 4, first + 4);
}

}  // namespace voxdag
