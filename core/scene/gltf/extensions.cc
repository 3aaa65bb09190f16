#include "core/scene/gltf/extensions.h"

#include <algorithm>
#include <string_view>

#include "core/scene/gltf/document.h"

namespace voxdag::gltf {
namespace {

constexpr std::string_view kRead[] = {"EXT_mesh_gpu_instancing", "KHR_mesh_quantization"};

// They say how things look, light, move or are described; no vertex depends on them.
constexpr std::string_view kHarmless[] = {
    "KHR_materials_",      "KHR_texture_",          "EXT_texture_", "MSFT_texture_",
    "KHR_lights_punctual", "EXT_lights_",           "KHR_xmp",      "KHR_animation_pointer",
    "ADOBE_materials_",    "MSFT_packing_",         "AGI_stk_",     "EXT_structural_metadata",
    "EXT_mesh_features",   "EXT_instance_features", "KHR_audio",    "KHR_techniques_webgl",
    "FB_geometry_metadata"};

bool is_read(std::string_view name) { return std::ranges::find(kRead, name) != std::end(kRead); }

bool is_harmless(std::string_view name) {
  return std::ranges::any_of(kHarmless, [&](auto prefix) { return name.starts_with(prefix); });
}

}  // namespace

void check_required_extensions(const std::string& path, const std::vector<std::string>& required) {
  for (const std::string& name : required)
    if (!is_read(name) && !is_harmless(name))
      refuse(path, "requires the extension " + printable(name) + ", which voxdag does not read");
}

std::vector<std::string> warn_of_unread_extensions(const std::string& path,
                                                   const std::vector<std::string>& used) {
  std::vector<std::string> warnings;
  for (const std::string& name : used)
    if (!is_read(name) && !is_harmless(name))
      warnings.push_back(path + ": the optional extension " + printable(name) + " is ignored");
  return warnings;
}

}  // namespace voxdag::gltf
