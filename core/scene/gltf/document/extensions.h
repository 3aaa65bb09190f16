// The extensions of glTF that voxdag reads, or that cannot change the geometry.
#pragma once

#include <string>
#include <vector>

namespace voxdag::gltf {

// Throws Error{kInvalidInput} naming the first required extension that voxdag does not read and
// that could change the geometry.
void check_required_extensions(const std::string& path, const std::vector<std::string>& required);

// Whether the geometry could be different if voxdag read the extension.
bool may_change_geometry(const std::string& extension);

}  // namespace voxdag::gltf
