#include "scene/gltf/extensions/extension_info.h"

#include <algorithm>

namespace voxdag::gltf {
namespace {

constexpr std::string_view kRead[] = {
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_avif",
    "EXT_texture_webp",
    "KHR_draco_mesh_compression",
    "KHR_materials_emissive_strength",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_unlit",
    "KHR_mesh_primitive_restart",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_node_visibility",
    "KHR_texture_transform",
};

constexpr const char* kMaterials = "it describes materials";
constexpr const char* kTextures = "it describes textures";
constexpr const char* kLights = "it describes lights";
constexpr const char* kMetadata = "it holds metadata";
constexpr const char* kSound = "it describes sound";
constexpr const char* kMotion = "it describes motion, and scenes are read at rest";
constexpr const char* kBehavior = "it describes behavior";

// Extensions that do not move vertices: all extensions whose names begin with `begin`.
struct Harmless {
  std::string_view begin;
  const char* purpose;
};

constexpr Harmless kHarmless[] = {
    {"ADOBE_materials_", kMaterials},
    {"EXT_materials_", kMaterials},
    {"FB_materials_", kMaterials},
    {"KHR_materials_", kMaterials},
    {"KHR_technique_webgl", kMaterials},
    {"KHR_techniques_webgl", kMaterials},
    {"MSFT_packing_", kMaterials},
    {"NV_materials_", kMaterials},
    {"VRMC_materials_", kMaterials},
    {"EXT_texture_", kTextures},
    {"KHR_texture_", kTextures},
    {"MOZ_lightmap", kTextures},
    {"MSFT_texture_", kTextures},
    {"EXT_lights_", kLights},
    {"KHR_environment_map", kLights},
    {"KHR_lights_", kLights},
    {"EXT_feature_metadata", kMetadata},
    {"EXT_instance_features", kMetadata},
    {"EXT_mesh_features", kMetadata},
    {"EXT_structural_metadata", kMetadata},
    {"FB_geometry_metadata", kMetadata},
    {"GODOT_single_root", kMetadata},
    {"KHR_xmp", kMetadata},
    {"KHR_audio", kSound},
    {"MSFT_audio_emitter", kSound},
    {"OMI_audio_", kSound},
    {"AGI_articulations", kMotion},
    {"AGI_stk_", kMotion},
    {"EXT_property_animation", kMotion},
    {"KHR_animation_pointer", kMotion},
    {"KHR_physics_", kMotion},
    {"MSFT_physics_", kMotion},
    {"OMI_collider", kMotion},
    {"OMI_physics_", kMotion},
    {"VRMC_springBone", kMotion},
    {"KHR_interactivity", kBehavior},
    {"KHR_node_hoverability", kBehavior},
    {"KHR_node_selectability", kBehavior},
    {"MOZ_hubs_components", kBehavior},
    {"OMI_link", kBehavior},
    {"OMI_seat", kBehavior},
    {"OMI_spawn_point", kBehavior},
    {"CESIUM_primitive_outline", "it describes lines on meshes"},
    {"EXT_mesh_manifold", "it describes how triangles are connected"},
    {"EXT_mesh_primitive_edge_visibility", "it describes lines on meshes"},
    {"FB_ngon_encoding", "it describes which triangles form a polygon"},
};

}  // namespace

ExtensionInfo extension_info(std::string_view name) {
  if (std::ranges::find(kRead, name) != std::end(kRead)) return {ExtensionSupport::kRead, ""};
  const auto found = std::ranges::find_if(
      kHarmless, [&](const Harmless& known) { return name.starts_with(known.begin); });
  if (found == std::end(kHarmless)) return {};
  return {ExtensionSupport::kHarmless, found->purpose};
}

}  // namespace voxdag::gltf
