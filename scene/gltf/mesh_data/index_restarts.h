// Finds the triangles of strips and fans with restarts.
#pragma once

#include "scene/gltf/document/document.h"
#include "scene/gltf/mesh_data/buffer_reader.h"

namespace voxdag::gltf {

// If the document uses KHR_mesh_primitive_restart, reads the indices of all drawn strips and fans
// and sets Primitive::restarts.
void index_restarts(Document& document, BufferReader& buffers);

}  // namespace voxdag::gltf
