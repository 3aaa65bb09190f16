#include "scene/obj/obj_mesh.h"

#include <algorithm>

#include "scene/surface_numbers.h"

namespace voxdag::obj {

bool ObjMesh::open_surfaces(unsigned cursors) {
  has_surfaces_ = true;
  if (obj_.has_colors()) colors_.emplace(obj_, obj_.vertices(), cursors, budget_);
  if (std::ranges::any_of(materials_.uses, &ObjMaterials::Use::has_image) && obj_.texcoords() > 0)
    texcoords_.emplace(obj_, obj_.texcoords(), cursors, budget_);
  return true;
}

void ObjMesh::read_surfaces(std::span<const uint32_t> numbers, const uint32_t* corners,
                            SurfaceTriangle* out) {
  for (const uint32_t number : numbers) {
    for (size_t k = 0; k < 3; ++k) {
      out->corners[k] = {};
      if (colors_) out->corners[k].color = colors_->at(corners[3 * size_t{number} + k]);
    }
    read_material(number, *out++);
  }
}

// Sets the material, and the texture coordinates if the triangle has them. In OBJ, v increases
// upward in the image.
void ObjMesh::read_material(size_t number, SurfaceTriangle& out) {
  const ObjMaterials::Use& use = materials_.uses[surfaces_.materials[number]];
  const uint32_t* const indices = &surfaces_.texcoords[3 * number];
  const bool has_coordinates = std::max({indices[0], indices[1], indices[2]}) < obj_.texcoords();
  out.material = use.has_image && !has_coordinates ? use.without_image : use.material;
  if (!use.has_image || !has_coordinates) return;
  for (size_t k = 0; k < 3; ++k) {
    const auto& [u, v] = texcoords_->at(indices[k]);
    out.corners[k].texture = {texture_lattice(use.scale[0] * u + use.offset[0]),
                              texture_lattice(1 - (use.scale[1] * v + use.offset[1]))};
  }
}

}  // namespace voxdag::obj
