// The numbers of vertices and faces in Draco data. Some programs write other counts to the
// accessors.
#pragma once

#include "scene/gltf/document/document.h"
#include "scene/gltf/mesh_data/buffer_reader.h"

namespace voxdag::gltf {

// Compares the counts of all decoded Draco primitives with the headers of their data. If they
// differ, replaces the primitive's counts, with a warning. Data that cannot be read are left for
// the decoder, which names the problem. Call it before the surfaces of the primitives are placed.
// Throws Error{kInvalidInput} if morph targets or joints then have a count that differs from
// the positions' count.
void correct_draco_counts(Document& document, BufferReader& buffers);

}  // namespace voxdag::gltf
