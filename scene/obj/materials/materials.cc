#include "scene/obj/materials/materials.h"

#include <algorithm>
#include <memory>
#include <unordered_map>

#include "core/base/error.h"
#include "scene/messages.h"
#include "scene/obj/materials/libraries.h"
#include "scene/obj/materials/mtl_reader.h"
#include "scene/surface_numbers.h"
#include "scene/text/side_files.h"
#include "scene/textures/linear_light.h"

namespace voxdag::obj {
namespace {

uint16_t light_of_channel(double value) {
  return value > 0 ? linear_light(std::min(value, 1.0)) : 0;  // 0 for NaN
}

// Converts a material of a library, except for its image.
Material to_material(const LibraryMaterial& in) {
  Material out;
  out.name = in.name;
  for (size_t c = 0; c < 3; ++c) out.factor[c] = light_of_channel(in.diffuse[c]);
  out.factor[3] = intensity_of(in.opacity);
  const bool has_alpha_image =
      !in.opacity_map.file.empty() && in.opacity_map.file == in.diffuse_map.file;
  if (out.factor[3] < kFullIntensity || has_alpha_image) out.alpha_mode = AlphaMode::kBlend;
  if (in.diffuse_map.is_clamped) out.wrap = {Wrap::kClampToEdge, Wrap::kClampToEdge};
  return out;
}

class MaterialList {
 public:
  MaterialList(FileSystem& files, const ObjFile& obj, MemoryBudget& budget)
      : files_(files), obj_(obj) {
    result_.charge = GrowingCharge(budget, "the materials of " + obj.file().path());
    listed_ = read_libraries(files, obj, budget, result_.charge, result_.scene.warnings);
    result_.files = listed_.files;
  }

  ObjMaterials make() {
    result_.scene.materials.clear();
    for (LibraryEntry& entry : listed_.materials) list(to_material(entry.material));
    const auto& uses = obj_.materials().all();
    for (const UsedMaterials::Use& use : uses) result_.uses.push_back(add_use(use));
    if (result_.scene.materials.empty()) append(Material{});
    return std::move(result_);
  }

 private:
  // Appends a material, and its name to SceneMaterials::names. Returns the material's index.
  uint32_t list(Material material) {
    material.number = static_cast<uint32_t>(result_.scene.names.size());
    result_.scene.names.push_back(material.name);
    return append(std::move(material));
  }
  uint32_t append(Material material) {
    result_.charge.add(2 * (sizeof(Material) + 2 * material.name.size()));
    result_.scene.materials.push_back(std::move(material));
    return static_cast<uint32_t>(result_.scene.materials.size()) - 1;
  }

  ObjMaterials::Use add_use(const UsedMaterials::Use& use) {
    if (use.faces == 0) return {};
    if (use.name.empty()) return {.material = append(Material{})};
    const std::optional<uint32_t> known = listed_.find(use.name);
    if (known) return use_listed(use, *known);
    Material white;
    white.name = use.name;
    warn("missing-material", use, "the material is in no library; its faces are white");
    return {.material = list(std::move(white))};
  }

  // Returns the appearance of the faces that use material `number` of the libraries. The number is
  // also the material's index in the scene, because make() first appends all materials of the
  // libraries.
  ObjMaterials::Use use_listed(const UsedMaterials::Use& use, uint32_t number) {
    const LibraryEntry& entry = listed_.materials[number];
    const LibraryMaterial& in = entry.material;
    ObjMaterials::Use out{.material = number};
    const bool has_other_map =
        !in.opacity_map.file.empty() && in.opacity_map.file != in.diffuse_map.file;
    if (has_other_map)
      warn("ignored-opacity-map", use, "its map_d is ignored, because it is not its map_Kd");
    if (in.diffuse_map.file.empty()) return out;
    if (in.diffuse == std::array<double, 3>{0, 0, 0}) {
      warn("black-diffuse", use, "its Kd is black; its map_Kd is used alone");
      std::fill_n(result_.scene.materials[number].factor.begin(), 3, kFullIntensity);
    }
    out.has_image = true;
    out.without_image = append(result_.scene.materials[number]);
    out.scale = in.diffuse_map.scale;
    out.offset = in.diffuse_map.offset;
    result_.scene.materials[number].image = image_of(entry);
    if (use.faces_without_texture > 0)
      warn("missing-texture-coordinates", use,
           "a face has no texture coordinates, or an index of them without a vt statement; its "
           "triangles without coordinates have the color Kd, without the map_Kd",
           use.faces_without_texture);
    return out;
  }

  // Returns the index of a material's image. Adds the image if it is new.
  uint32_t image_of(const LibraryEntry& entry) {
    const std::string& library = listed_.files[entry.library].path;
    const std::string& name = entry.material.diffuse_map.file;
    const auto [place, is_new] =
        images_.try_emplace(parent_directory(library) + '\0' + name,
                            static_cast<uint32_t>(result_.scene.images.size()));
    if (is_new) result_.scene.images.push_back(open_image(library, name));
    return place->second;
  }

  ImageSource open_image(const std::string& library, const std::string& name) {
    result_.charge.add(sizeof(ImageSource) + 4 * (library.size() + name.size()));
    ImageSource out;
    out.name = library + ": image \"" + printable(name) + "\"";
    try {
      const auto file = open_side_file(files_, library, name);
      out.file = {file->path(), file->identity()};
      out.size = file->size();
    } catch (const Error& error) {
      out.problem = "cannot be opened (" + error.message() + ")";
    }
    return out;
  }

  void warn(const char* code, const UsedMaterials::Use& use, const char* message,
            uint64_t count = 1) {
    result_.scene.warnings.add({code,
                                obj_.file().path() + ": line " + std::to_string(use.line) +
                                    ": material \"" + printable(use.name) + "\"",
                                message, count});
  }

  FileSystem& files_;
  const ObjFile& obj_;
  ObjMaterials result_;
  Libraries listed_;
  std::unordered_map<std::string, uint32_t> images_;
};

}  // namespace

ObjMaterials read_materials(FileSystem& files, const ObjFile& obj, MemoryBudget& budget) {
  return MaterialList(files, obj, budget).make();
}

}  // namespace voxdag::obj
