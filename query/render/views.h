// Where to look from when the user does not say.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "query/ray_caster.h"
#include "query/render/bounds.h"
#include "query/render/camera.h"

namespace voxdag::query {

// "auto", "iso", "front", "back", "left", "right", "top", "inside".
const std::vector<std::string>& view_names();

// Throws Error{kInvalidInput} listing the names for one that is not there. "auto" is "inside" for a
// scene most of which cannot be seen from without, and "iso" for any other. Without a field of view
// in degrees, one that suits the view.
Placement named_view(const std::string& name, const RayCaster& caster, const DagView& dag,
                     const Box& box, double aspect, std::optional<double> fov_degrees);

// How far one sees from random places on the surface, as a share of the scene's extent and 0 for
// places from which one can see out: next to nothing for a thing, or for caves; more for rooms.
double enclosure(const RayCaster& caster, const DagView& dag, const Box& box);

// A place within the scene with a long view, walls around and a floor below.
Placement inside_view(const RayCaster& caster, const Box& box, double fov_degrees);

}  // namespace voxdag::query
