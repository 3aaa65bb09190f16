// Camera placements for users who do not give one.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "query/dag_view.h"
#include "query/render/camera.h"

namespace voxdag::query {

// "auto", "iso", "front", "back", "left", "right", "top", "inside".
const std::vector<std::string>& view_names();

// The placement of a named view of a DAG that is not empty. "inside" is a place within the scene
// with a long view, walls around and a floor below; "auto" is "inside" for a scene most of which
// cannot be seen from outside, and "iso" for any other. `aspect` is the picture's width divided by
// its height; without `fov_degrees`, the view decides on the field of view. Throws
// Error{kInvalidInput} listing the names for an unknown one.
Placement named_view(const std::string& name, const DagView& dag, double aspect,
                     std::optional<double> fov_degrees);

}  // namespace voxdag::query
