// Checks the members of materials, textures and samplers that voxdag reads. tinygltf ignores
// members of a wrong type without a message.
#pragma once

#include <functional>
#include <string>

#include "scene/gltf/json/element_text.h"

namespace voxdag::gltf {

// The three sections of a file that tinygltf parses.
enum class MaterialSection { kMaterials, kTextures, kSamplers };

// Receives the name of the element ("" if it has none), and a message about one of its members.
using ReportMember = std::function<void(const std::string& name, const std::string& message)>;

// Returns the JSON text of the element without the members that break a rule of glTF. Reports each
// of these members, and each required member that is missing. For an element that is not an object,
// reports it and returns the text "{}".
std::string without_broken_members(MaterialSection section, const ElementText& element,
                                   const ReportMember& report);

}  // namespace voxdag::gltf
