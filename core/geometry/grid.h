// The voxel grid in world space, and how world positions are snapped to its fixed-point lattice.
//
// All values are computed in IEEE doubles with only + - * /, and compiled without fused
// multiply-add, so that every machine snaps to the same positions. For a scene with the bounds lo
// and hi, the default cube is
//     edge   = max(hi - lo) * (1 + 2^-15)        origin = 0.5 * (lo + hi) - 0.5 * edge
// The cube does not depend on R, the number of voxels along its edge. A world coordinate w is x
// voxels from the origin and is snapped to the lattice coordinate u:
//     x      = ((w - origin) / edge) * R         u      = 2 * floor(128 * x) + 1
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/geometry/cube.h"
#include "core/geometry/fixed_triangle.h"

namespace voxdag {

struct WorldBounds {
  std::array<double, 3> low{};
  std::array<double, 3> high{};
  bool empty = true;

  void add(const WorldBounds& other);
};

// Vertex positions, double precision, [vertex][axis].
struct RealTriangle {
  double v[3][3];
};
// A triangle in world space.
using WorldTriangle = RealTriangle;
// A triangle on the lattice of a grid. Its coordinates are odd integers of any magnitude, stored as
// doubles.
using SnappedTriangle = RealTriangle;

// Returns the bounds of triangles with finite vertices.
WorldBounds bounds_of(std::span<const WorldTriangle> triangles);

struct Grid {
  uint32_t levels = 2;  // L; R = 2^L voxels along an edge
  std::array<double, 3> origin{};
  double edge = 1.0;

  int64_t resolution() const { return int64_t{1} << levels; }
  bool operator==(const Grid&) const = default;

  // Returns the default cube around a scene. A scene without extent, or without triangles, gets
  // edge 1. Throws Error{kInvalidInput} for levels outside [2, 20], Error{kLimit} if the grid is
  // not finite.
  static Grid around(const WorldBounds& bounds, uint32_t levels);
  // Returns the grid with the low corner `origin` and the edge `edge`. Throws Error{kInvalidInput}
  // unless all these numbers are finite, the edge is > 0 and the levels are in [2, 20].
  static Grid given(const std::array<double, 3>& origin, double edge, uint32_t levels);
  // Returns the grid whose voxels have the edge `voxel_size` and whose center is the scene's
  // center. Throws Error{kInvalidInput} if the scene does not fit in this grid, or if the size or
  // the levels are invalid, and Error{kLimit} if the grid is not finite. The error recommends only
  // grids of at most `max_levels` levels.
  static Grid with_voxel_size(const WorldBounds& bounds, double voxel_size, uint32_t levels,
                              uint32_t max_levels = kMaxGridLevels);
  // Returns the smallest number of levels with which a grid of voxels of this edge contains the
  // scene. Throws Error{kInvalidInput} if the scene fits in no grid of at most `max_levels` levels,
  // or if the size is invalid.
  static uint32_t levels_for_voxel_size(const WorldBounds& bounds, double voxel_size,
                                        uint32_t max_levels = kMaxGridLevels);
};

enum class SnapResult {
  kInside,   // the triangle's bounding box touches the grid
  kOutside,  // the bounding box misses the grid; a build drops and counts the triangle
  kTooFar,   // the box touches the grid, but a coordinate exceeds kCoordinateLimit; a build fails
};

// Snaps vertices, three coordinates each, in place. NaN remains NaN.
void snap_vertices(const Grid& grid, std::span<double> coordinates);
// Converts a snapped triangle to integers. Sets `out` only if the result is kInside.
SnapResult to_fixed(const Grid& grid, const SnappedTriangle& snapped, FixedTriangle& out);
// Snaps a triangle with finite vertices and converts it with to_fixed().
SnapResult snap_triangle(const Grid& grid, const WorldTriangle& world, FixedTriangle& out);

// Returns log2 of a resolution. Throws Error{kInvalidInput} unless it is a power of two in [4,
// 2^20].
uint32_t levels_of_resolution(uint64_t resolution);

}  // namespace voxdag
