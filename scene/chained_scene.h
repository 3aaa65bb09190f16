// Several scenes as one: the triangles of the first, then those of the next.
#pragma once

#include <memory>
#include <vector>

#include "scene/triangle_source.h"

namespace voxdag {

// Appends the materials of another source.
void add_materials(SceneMaterials& all, SceneMaterials more);
// A visitor of triangles whose materials are numbered from `first_material` on. `visit` must
// outlive it.
TriangleCursor::SurfaceVisitor with_material_offset(uint32_t first_material,
                                                    const TriangleCursor::SurfaceVisitor& visit);

// Throws Error{kLimit} for 2^63 triangles and more.
std::unique_ptr<TriangleSource> chain_scenes(std::vector<std::unique_ptr<TriangleSource>> parts);

}  // namespace voxdag
