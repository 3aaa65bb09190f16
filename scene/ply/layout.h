// The elements and properties of a PLY file that make its triangles and their surfaces. They are
// found by their names, in upper or lower case.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "scene/ply/rows/header.h"
#include "scene/ply/rows/rows.h"

namespace voxdag::ply {

struct Layout {
  static constexpr size_t kNone = RequestedProperties::kNone;

  // Indices of the elements vertex, face and tristrips; kNone for an element that is absent or has
  // no rows.
  size_t vertex = kNone, face = kNone, strips = kNone;
  std::array<size_t, 3> axes{};  // x, y and z of the vertices
  size_t face_indices = kNone;   // the list of vertex indices
  size_t strip_indices = kNone;

  // Red, green, blue and, if present, alpha. Empty unless all three colors exist. Colors of faces
  // are empty if the vertices have colors.
  std::vector<size_t> vertex_colors, face_colors;
  // Texture coordinates: two numbers per vertex, or a list of two numbers per corner of a face. If
  // the header names no texture file, `vertex_texture` is empty and `face_texture` is kNone.
  std::vector<size_t> vertex_texture;
  size_t face_texture = kNone;
  size_t texture_number = kNone;  // property of faces, an index into texture_files

  std::vector<std::string> ignored_colors;  // names of color properties that are not read
};

// Throws Error{kInvalidInput} if an element or property is missing or has a wrong type,
// Error{kLimit} for more than 2^32 - 2 vertices. `path` is for messages.
Layout find_layout(const Header& header, const std::string& path);

}  // namespace voxdag::ply
