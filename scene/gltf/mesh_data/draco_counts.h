// The numbers of vertices and faces in Draco data. Some programs write other counts to the
// accessors.
#pragma once

#include "scene/gltf/document/document.h"
#include "scene/gltf/mesh_data/buffer_reader.h"

namespace voxdag::gltf {

// Compares the counts of all Draco primitives that have no fallback with the headers of their data.
// If they differ, replaces the primitive's counts, with a warning. Skips data that cannot be read:
// the decoder will report them. Call it before place_draco_surface(). Throws Error{kInvalidInput}
// if the number of elements of a morph target or a joint set then differs from the number of
// positions.
void correct_draco_counts(Document& document, BufferReader& buffers);

}  // namespace voxdag::gltf
