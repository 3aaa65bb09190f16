// Joins scenes: the triangles of the first scene, then the triangles of the next.
#pragma once

#include <memory>
#include <vector>

#include "scene/triangle_source.h"

namespace voxdag {

// Returns one scene with the triangles, materials, files and warnings of all `parts`, in this
// order, and the additional `warnings`. Throws Error{kLimit} for 2^63 or more triangles.
std::unique_ptr<TriangleSource> chain_scenes(std::vector<std::unique_ptr<TriangleSource>> parts,
                                             std::vector<Warning> warnings = {});

}  // namespace voxdag
