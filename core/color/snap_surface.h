// Snaps triangles with their appearance to the lattice of a grid.
#pragma once

#include "core/color/surface.h"
#include "core/geometry/grid.h"

namespace voxdag {

// Copies everything but the position.
inline void copy_appearance(const SurfaceTriangle& from, FixedSurface& to) {
  to.corners = from.corners;
  to.material = from.material;
  to.is_flipped = from.is_flipped;
}

// Snaps a triangle and copies its appearance. Sets `out` only if the result is kInside.
inline SnapResult snap_surface(const Grid& grid, const SurfaceTriangle& world, FixedSurface& out) {
  const SnapResult result = snap_triangle(grid, world.position, out.position);
  if (result == SnapResult::kInside) copy_appearance(world, out);
  return result;
}

}  // namespace voxdag
