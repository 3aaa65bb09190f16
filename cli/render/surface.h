// Where the surface lies around a cell that was hit, judged from the occupied cells near it.
#pragma once

#include "cli/render/dag_view.h"
#include "cli/render/ray_caster.h"
#include "cli/render/vec.h"

namespace voxdag::render {

// The normal of the plane that fits the occupied cells within three of the hit one best, on the
// side that the ray came from. Where too few are near for a plane, the face that was entered.
Vec surface_normal(const DagView& dag, const Hit& hit, const Vec& direction);

// The normal of the face through which a cell was entered.
Vec face_normal(const Hit& hit, const Vec& direction);

}  // namespace voxdag::render
