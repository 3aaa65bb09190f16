// The sum of a vertex's skin weights, over all of its joint sets. It should be 1.
#pragma once

#include <cmath>
#include <cstdint>

#include "core/base/warning.h"
#include "scene/gltf/document/document.h"
#include "scene/gltf/mesh_data/buffer_reader.h"

namespace voxdag::gltf {

constexpr size_t kInfluencesOfSet = 4;

// True if the weights are used unchanged. The sum of weights that were rounded to floats differs
// from 1 by less than 1e-5. A sum of 16-bit integers that is wrong by one unit differs by more.
inline bool is_normalized(double sum) { return std::abs(sum - 1) <= 1e-5; }

// Reads the weights of all skinned primitives of the scene. Adds a warning for each primitive that
// has vertices without weights, or with weights that are not normalized.
void warn_of_weights(const Document& document, BufferReader& buffers, WarningList& warnings);

}  // namespace voxdag::gltf
