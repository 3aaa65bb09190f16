// A triangle prepared for the rasterizers: the overlap test of core/geometry/overlap.h (Schwarz and
// Seidel 2010, section 4.1) as exact integer tests on the voxels of one tile.
//
// Let v be the vertices relative to the tile's low corner, k the coordinates of a voxel in the
// tile, and n the quarter normal, which is the cross product of two half-edges. Half-edges are
// integers, because lattice coordinates of vertices are odd, so edges are even. The two tests are:
//
//   plane   n.(256 k - v0) changes sign over the voxel's box   <=>   0 <= n.k + lowest <= width
//   edge    the edge function's largest value over the box, in one of the three projections, is
//           not negative                                       <=>   a k_p + b k_q + c >= 0
//
// set_up() computes the integers lowest, width, a, b and c once per tile. The tests do not need the
// lowest eight bits of a coordinate, its position within a voxel, because for an integer i and any
// x, 256 i + x >= 0 <=> i + floor(x / 256) >= 0.
//
// Bounds for narrow triangles (triangle_set.h): the extent along every axis is at most 2^28, so
// half-edges are <= 2^27. A projected triangle covers at most half of its bounding rectangle. So
// each component of the cross product of two complete edges is <= 2^56, and the quarter normal has
// |n_a| <= 2^54. The sum of |n_a| is <= 3 * 2^54. If the plane misses the tile, there is nothing to
// draw. Otherwise n.k + lowest reaches the range from 0 to width in the tile of 64^3 voxels, where
// width <= 3 * 2^54. So |n.k + lowest| <= 64 * 3 * 2^54 < 2^62 at every corner of a voxel. For
// edges, |a|, |b| <= 2^27. The triangle's box touches the tile, so |v| < 2^29. c is the constant
// part of the edge function, which is below 2^57, divided by 256, plus at most |a| + |b|. So
// |c| < 2^50.
//
// Bounds for wide triangles (triangle_set.h): coordinates are below 2^40. So |v| < 2^41 relative to
// the tile, half-edges are < 2^40, |n_a| < 2^81, and |n.v| < 3 * 2^122 fits in 128 bits. The
// constant part of an edge function is below 2^82. set_up() divides it by 256, and clamps the
// result to +-2^60, because c has only 64 bits. A clamped constant still decides the sign of
// a k_p + b k_q + c, because all other terms together are at most 64 (|a| + |b|) < 2^47.
#pragma once

#include <cstdint>
#include <type_traits>

#include "core/backend/cpu/raster/triangle_set.h"
#include "core/base/integers.h"

namespace voxdag::cpu {

template <class Coordinate>
struct TileTriangle {
  static constexpr bool kNarrow = sizeof(Coordinate) == 4;
  using Int = std::conditional_t<kNarrow, int64_t, int128>;

  // An edge in the projection along axis d. Let p and q be a voxel's coordinates along the axes
  // d + 1 and d + 2 (modulo 3). The voxel touches the inner side of the edge iff
  // a p + b q + c >= 0.
  struct Edge {
    int64_t a, b, c;
  };

  bool inside;  // the triangle covers the tile (triangle_set.h); `edges` is not set
  int first_voxel[3], last_voxel[3];
  int dominant;   // axis of the normal's largest component, which is >= 0
  Int normal[3];  // all 0 if the triangle is degenerate
  Int lowest;
  Int width;
  Edge edges[3][3];  // [projection][edge]

  // Prepares a triangle. Returns false if the triangle certainly touches no voxel of the tile.
  // `is_inside`: true if the triangle covers the tile (triangle_set.h).
  bool set_up(const Triangle<Coordinate>& triangle, bool is_inside, const LatticeCube& tile);

 protected:
  static Int positive_part(Int x) { return x > 0 ? x : 0; }
  // Sets v[axis][vertex] to the vertices relative to the tile's low corner, and first_voxel and
  // last_voxel to the voxels of the tile in the triangle's box. Returns false if the triangle's box
  // misses the tile.
  bool set_box(const Triangle<Coordinate>& triangle, const LatticeCube& tile, int64_t (&v)[3][3]);
  // Sets half[axis][i] to the half-edges: the edge vectors from vertex i to vertex i + 1 (modulo
  // 3), divided by 2.
  static void set_halves(const int64_t (&v)[3][3], int64_t (&half)[3][3]);
  // Sets `normal` and `dominant`, and `size` to the magnitudes of the normal's components. If the
  // dominant component is negative, negates the normal and the half-edges.
  void set_normal(int64_t (&half)[3][3], Int (&size)[3]);

 private:
  bool set_plane(const int64_t (&v)[3][3], int64_t (&half)[3][3], int64_t tile_voxels);
  void set_edges(const int64_t (&v)[3][3], const int64_t (&half)[3][3]);
};

}  // namespace voxdag::cpu
