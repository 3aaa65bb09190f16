// The matrices of a skin's joints at rest: global transform of the joint times inverse bind matrix.
// The transform of the skinned node itself is not used (glTF 2.0, section 3.7.3.3).
#pragma once

#include "core/base/page_buffer.h"
#include "core/scene/gltf/document/document.h"
#include "core/scene/gltf/geometry/buffer_reader.h"

namespace voxdag::gltf {

// One matrix per joint. Throws Error{kInvalidInput} for an inverse bind matrix that is not affine,
// Error{kOutOfMemory} naming the skin for more joints than fit the budget of `buffers`.
PageBuffer<Transform> joint_matrices(const Document& document, BufferReader& buffers, int skin);

}  // namespace voxdag::gltf
