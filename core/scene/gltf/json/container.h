// The two containers of glTF 2.0: a GLB (a header, a JSON chunk, perhaps a BIN chunk), or the bare
// JSON of a .gltf. Which of them a file is, its first bytes say.
#pragma once

#include "core/io/file_system.h"
#include "core/scene/gltf/document/document.h"

namespace voxdag::gltf {

struct Container {
  FileRange json;
  bool has_bin = false;
  FileRange bin;
};

// Throws Error{kInvalidInput} for a broken container, Error{kLimit} for JSON over 1 GiB.
Container read_container(const ReadableFile& file);

}  // namespace voxdag::gltf
