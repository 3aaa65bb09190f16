#include "scene/ply/ply_mesh.h"

namespace voxdag::ply {

void PlyMesh::read_surfaces(std::span<const uint32_t> numbers, const uint32_t* corners,
                            SurfaceTriangle* out) {
  for (const uint32_t number : numbers) {
    out->material = 0;
    for (size_t k = 0; k < 3; ++k)
      out->corners[k] = {{}, colors_->at(corners[3 * size_t{number} + k])};
    ++out;
  }
}

}  // namespace voxdag::ply
