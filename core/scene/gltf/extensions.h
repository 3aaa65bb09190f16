// Which extensions of glTF a scene may ask for.
#pragma once

#include <string>
#include <vector>

namespace voxdag::gltf {

// Throws Error{kInvalidInput} naming the first required extension that voxdag does not read and
// that could change the geometry.
void check_required_extensions(const std::string& path, const std::vector<std::string>& required);

// One sentence for each extension that is used, not required, and not read.
std::vector<std::string> warn_of_unread_extensions(const std::string& path,
                                                   const std::vector<std::string>& used);

}  // namespace voxdag::gltf
