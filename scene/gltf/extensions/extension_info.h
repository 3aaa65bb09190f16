// The table of known glTF extensions.
#pragma once

#include <string_view>

namespace voxdag::gltf {

enum class ExtensionSupport {
  kRead,      // voxdag reads it
  kHarmless,  // it does not move vertices, so voxdag can ignore it
  kUnknown    // it may move vertices, so the voxels may be wrong if it is ignored
};

struct ExtensionInfo {
  ExtensionSupport support = ExtensionSupport::kUnknown;
  const char* purpose = "";  // purpose of a harmless extension: "it describes materials"
};

ExtensionInfo extension_info(std::string_view name);

}  // namespace voxdag::gltf
