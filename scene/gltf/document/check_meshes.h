// Checks the meshes and skins that the scene draws. Other meshes and skins are not checked.
#pragma once

#include <string>

#include "scene/gltf/document/document.h"

namespace voxdag::gltf {

// Marks the meshes that nodes of the scene draw. Checks these meshes, and the skins and instances
// of the nodes. Calls place_draco_primitive() (compression.h) for primitives that Draco has
// compressed. Throws Error{kInvalidInput}.
void check_drawn_meshes(Document& document);

// Returns the buffer of decoded Draco data that has the primitive's positions. Returns null if the
// positions are not compressed by Draco. The primitive must be checked.
BufferSource* decoded_buffer(Document& document, const Primitive& primitive);

// Checks that morph targets, joints and weights have as many elements as the positions.
void check_vertex_counts(const Document& document, const Primitive& primitive,
                         const std::string& where);

}  // namespace voxdag::gltf
