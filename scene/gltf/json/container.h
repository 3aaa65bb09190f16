// The two containers of glTF 2.0: a GLB (a header, a JSON chunk and an optional BIN chunk), or the
// plain JSON of a .gltf. They are distinguished by the first bytes of the file, not by its name.
// Chunks of other types are skipped, and zeros after the JSON are padding.
#pragma once

#include "core/io/file_system.h"
#include "scene/gltf/json/file_range.h"

namespace voxdag::gltf {

struct Container {
  FileRange json;
  bool has_bin = false;
  FileRange bin;
};

// True if the file is a GLB, or begins like JSON: with an object or an array, perhaps after a byte
// order mark and white space.
bool is_gltf(const ReadableFile& file);

// Throws Error{kInvalidInput} for a broken container, Error{kLimit} for JSON over 1 GiB.
Container read_container(const ReadableFile& file);

}  // namespace voxdag::gltf
