// A small indexed mesh in memory, and the shapes that generated scenes consist of. A mesh has at
// most 65 535 vertices, so that 16-bit indices suffice (the index 65 535 is glTF's restart value).
// Coordinates are computed in doubles and rounded to float once, when a vertex is added.
#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <vector>

namespace voxdag {

struct Vec3 {
  double x = 0, y = 0, z = 0;
};
inline Vec3 operator+(const Vec3& a, const Vec3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(const Vec3& a, const Vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator*(const Vec3& a, double s) { return {a.x * s, a.y * s, a.z * s}; }

// Linear red, green, blue and alpha, as glTF requires for vertex colors.
using Rgba8 = std::array<uint8_t, 4>;
constexpr Rgba8 kWhite{255, 255, 255, 255};

using Float3 = std::array<float, 3>;
inline Float3 rounded(const Vec3& v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

// A rotation about the y axis. Its cosine and sine are quotients of integers from Pythagorean
// triples, because sin() differs between machines.
struct Turn {
  double cosine = 1, sine = 0;
};
// Returns a rotation from a fixed list of 12. Its index in the list is `choice` modulo 12.
Turn pythagorean_turn(uint32_t choice);

struct MeshBuilder {
  static constexpr uint32_t kMaxVertices = 65535;
  static constexpr uint32_t kMaxTriangles = 131072;

  std::vector<Float3> positions;
  std::vector<Rgba8> colors;  // colors of the vertices; empty in a scene without colors
  std::vector<uint16_t> indices;

  uint32_t vertices() const { return static_cast<uint32_t>(positions.size()); }
  uint32_t triangles() const { return static_cast<uint32_t>(indices.size() / 3); }

  // Color of vertices added later. If no color is set, the mesh has no colors.
  std::optional<Rgba8> color;
  uint32_t material = 0;

  void add_vertex(const Vec3& p) {
    positions.push_back(rounded(p));
    if (color) colors.push_back(*color);
  }
  // Adds vertices and returns the index of the first.
  uint32_t add_vertices(std::initializer_list<Vec3> corners);
  void add_triangle(uint32_t a, uint32_t b, uint32_t c);
  // Adds a triangle with 3 new vertices.
  void triangle(const Vec3& a, const Vec3& b, const Vec3& c);
  // Adds a quad with 4 new vertices, counter-clockwise seen from outside.
  void quad(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d);
  // Adds a box: 8 new vertices and 12 triangles (10 without the bottom).
  void box(const Vec3& low, const Vec3& high, bool bottom = true);
  // Adds a box without bottom that stands on `base`, turned about its vertical axis: 8 new
  // vertices, 10 triangles. In `half_and_height`, x and z are half of the edges, and y is the
  // height.
  void turned_box(const Vec3& base, const Vec3& half_and_height, const Turn& turn);
  // Adds a pyramid on a turned rectangle, with turned_box()'s parameters: 5 new vertices, 4
  // triangles.
  void pyramid(const Vec3& base, const Vec3& half_and_height, const Turn& turn);
};

}  // namespace voxdag
