// A triangle prepared for the rasterizers of the rule kThin: the crossings of crossing.h as exact
// integer tests on the voxels of one tile.
//
// The notation is tile_triangle.h's. A voxel k is set iff for one of the axes a both tests hold:
//
//   plane   the plane crosses the row along a through the voxel's center, within the voxel
//                                   <=>   0 <= n.k + lowest_along[a] <= width_along[a]
//   edge    the row crosses the triangle, in the projection along a
//                                   <=>   a k_p + b k_q + c >= 0 for the edges of edges[a]
//
// Let F be the value of n.(p - v0) at the voxel's center, moved by an infinitely small vector so
// that F is never 0. The plane crosses the row along a within the voxel iff |F| < 128 |n_a|. So if
// the plane test along the dominant axis excludes a voxel, the tests along all axes exclude it. In
// each voxel column along the dominant axis, exactly one voxel passes the plane test.
//
// If the triangle covers the tile (triangle_set.h), all rows along the dominant axis cross it. Then
// the plane test along this axis decides alone.
#pragma once

#include "core/backend/cpu/raster/tile_triangle.h"

namespace voxdag::cpu {

// `lowest` and `width` of the base class have the values of lowest_along and width_along for the
// dominant axis.
template <class Coordinate>
struct ThinTriangle : TileTriangle<Coordinate> {
  using Int = typename TileTriangle<Coordinate>::Int;

  Int lowest_along[3];
  Int width_along[3];  // -1 if the triangle is parallel to the axis

  // Prepares a triangle. Returns false if the triangle certainly sets no voxel of the tile, and for
  // all degenerate triangles. `is_inside`: true if the triangle covers the tile (triangle_set.h).
  bool set_up(const Triangle<Coordinate>& triangle, bool is_inside, const LatticeCube& tile);

 private:
  bool set_planes(const int64_t (&v)[3][3], const Int (&size)[3], int64_t tile_voxels);
  void set_rows(const int64_t (&v)[3][3], const int64_t (&half)[3][3]);
};

}  // namespace voxdag::cpu
