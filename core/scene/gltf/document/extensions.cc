#include "core/scene/gltf/document/extensions.h"

#include <algorithm>
#include <string_view>

#include "core/scene/gltf/messages.h"

namespace voxdag::gltf {
namespace {

constexpr std::string_view kRead[] = {"EXT_mesh_gpu_instancing", "KHR_mesh_quantization"};

// Beginnings of the names of extensions for looks, lights, motion and metadata, which no vertex
// depends on.
constexpr std::string_view kHarmless[] = {
    "KHR_materials_",      "KHR_texture_",          "EXT_texture_", "MSFT_texture_",
    "KHR_lights_punctual", "EXT_lights_",           "KHR_xmp",      "KHR_animation_pointer",
    "ADOBE_materials_",    "MSFT_packing_",         "AGI_stk_",     "EXT_structural_metadata",
    "EXT_mesh_features",   "EXT_instance_features", "KHR_audio",    "KHR_techniques_webgl",
    "FB_geometry_metadata"};

}  // namespace

bool may_change_geometry(const std::string& extension) {
  return std::ranges::find(kRead, extension) == std::end(kRead) &&
         std::ranges::none_of(kHarmless, [&](auto p) { return extension.starts_with(p); });
}

void check_required_extensions(const std::string& path, const std::vector<std::string>& required) {
  for (const std::string& name : required)
    if (may_change_geometry(name))
      refuse(path, "requires the extension " + printable(name) + ", which voxdag does not read");
}

}  // namespace voxdag::gltf
