// URIs of external buffers: relative paths, percent-encoded (RFC 3986).
#pragma once

#include <string>

namespace voxdag::gltf {

// The path of the file that `uri` names relative to the folder of the scene file. Throws
// Error{kInvalidInput} naming `where` for an absolute path, a scheme, or a broken escape.
std::string resolve_uri(const std::string& scene_path, const std::string& uri,
                        const std::string& where);

}  // namespace voxdag::gltf
