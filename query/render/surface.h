// Where the surface lies around a cell that was hit, judged from the occupied cells near it.
#pragma once

#include "query/dag_view.h"
#include "query/ray_caster.h"
#include "query/vec.h"

namespace voxdag::query {

struct Surface {
  double t = 0;     // where the ray met it
  double size = 0;  // of the cell, in voxels
  Vec normal;       // toward the side that the ray came from
  Vec start;        // free space just before it, from where rays to the light set out
};

// The first surface on a ray through a pixel that is `pixel_spread` wide at distance 1; false if
// there is none. Voxels of many pixels are shown as the cubes they are, smaller ones as the surface
// that they sample.
bool find_surface(const DagView& dag, const Ray& ray, double pixel_spread, Surface& surface);

// The normal of the plane that fits the occupied cells within three of the hit one best, on the
// side that the ray came from. Where too few are near for a plane, the face that was entered.
Vec plane_normal(const DagView& dag, const Hit& hit, const Vec& direction);

// The normal of the face through which a cell was entered.
Vec face_normal(const Hit& hit, const Vec& direction);

}  // namespace voxdag::query
