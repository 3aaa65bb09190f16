// The matrices of a skin's joints at rest: global transform of the joint times inverse bind matrix.
// The transform of the skinned node itself plays no part (glTF 2.0, section 3.7.3.3).
#pragma once

#include <vector>

#include "core/scene/gltf/document/document.h"
#include "core/scene/gltf/geometry/buffer_reader.h"

namespace voxdag::gltf {

// One per joint. Throws Error{kInvalidInput} for an inverse bind matrix that is not affine.
std::vector<Transform> joint_matrices(const Document& document, BufferReader& buffers, int skin);

}  // namespace voxdag::gltf
