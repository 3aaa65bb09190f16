// The two containers of glTF 2.0: a GLB (a header, a JSON chunk, perhaps a BIN chunk), or the bare
// JSON of a .gltf. The first bytes of a file tell which of them it is, not its name.
#pragma once

#include "core/io/file_system.h"
#include "scene/gltf/json/file_range.h"

namespace voxdag::gltf {

struct Container {
  FileRange json;
  bool has_bin = false;
  FileRange bin;
};

// Throws Error{kInvalidInput} for a broken container, Error{kLimit} for JSON over 1 GiB.
Container read_container(const ReadableFile& file);

}  // namespace voxdag::gltf
