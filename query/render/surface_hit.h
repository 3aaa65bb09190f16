// The surface that a ray meets, with a normal estimated from the occupied cells near the hit.
// Stateless; thread-safe.
#pragma once

#include <cstdint>

#include "query/dag/dag_view.h"
#include "query/dag/vec.h"
#include "query/rays/ray_caster.h"

namespace voxdag::query {

// Maximum distance, in voxels, at which a surface is seen.
inline constexpr double kFarthest = 1e30;
// Returns the cone of a ray through a pixel that is `pixel_spread` wide at distance 1. A ray ends
// at an occupied cell that is at most three quarters of a pixel wide. The ray visits no finer
// cells.
inline Cone visible_cone(double pixel_spread) { return {0, 0.75 * pixel_spread}; }

struct SurfaceHit {
  double t = 0;          // ray parameter of the hit
  double size = 0;       // edge of the cell that was hit, in voxels
  uint32_t depth = 0;    // depth of this cell below the root
  int64_t cell[3] = {};  // position of this cell, in units of its edge
  Vec normal;            // unit vector on the side that the ray came from
  Vec start;             // free point in front of the surface, where rays to the light start
};

// Finds the first surface on a ray through a pixel that is `pixel_spread` wide at distance 1.
// Returns false if none exists. A voxel that covers many pixels looks like a cube. Smaller voxels
// look like the smooth surface from which they were sampled. Throws Error{kCorrupt} for a damaged
// DAG.
bool find_surface(const DagView& dag, const Ray& ray, double pixel_spread, SurfaceHit& surface);

}  // namespace voxdag::query
