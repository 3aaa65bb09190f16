// Pieces of a scene file.
#pragma once

#include <cstdint>

namespace voxdag::gltf {

// Bytes [begin, begin + size) of the scene file.
struct FileRange {
  uint64_t begin = 0;
  uint64_t size = 0;
};

// Position of a JSON string in the scene file.
struct RawString {
  FileRange characters;     // between the quotes
  bool is_escaped = false;  // has JSON escapes
  bool is_clipped = false;  // the parser received only the first characters (JsonWindow)
};

}  // namespace voxdag::gltf
