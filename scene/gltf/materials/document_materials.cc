#include "scene/gltf/materials/document_materials.h"

#include <algorithm>
#include <map>
#include <memory>
#include <optional>

#include "core/base/error.h"
#include "scene/gltf/document/check_document.h"
#include "scene/gltf/document/tinygltf.h"
#include "scene/gltf/materials/material_reader.h"
#include "scene/messages.h"

namespace voxdag::gltf {
namespace {

class MaterialResolver {
 public:
  explicit MaterialResolver(Document& document) : document_(document) {
    result_.warnings = document.material_warnings;
    const auto count = static_cast<int>(document.model->materials.size());
    for (int i = 0; i < count; ++i) add_material(i);
  }

  void resolve() {
    for (size_t m = 0; m < document_.meshes.size(); ++m) {
      if (!document_.meshes[m].is_drawn) continue;
      std::vector<Primitive>& primitives = document_.meshes[m].primitives;
      for (size_t p = 0; p < primitives.size(); ++p) {
        if (!primitives[p].makes_triangles()) continue;
        where_ = document_.name_mesh(static_cast<int>(m)) + ": primitive " + std::to_string(p);
        resolve(primitives[p]);
      }
    }
    if (result_.materials.empty()) plain_material();
    document_.materials = std::make_shared<DocumentMaterials>(std::move(result_));
  }

 private:
  void add_material(int index) {
    MaterialSource source = read_material(*document_.model, index);
    source.material.number = static_cast<uint32_t>(index);
    if (!source.problem.empty())
      warn("unusable-texture", "material " + numbered(index, source.material.name),
           source.problem + "; its base color factor is used alone");
    if (!source.sampler_problem.empty())
      warn("broken-material", "material " + numbered(index, source.material.name),
           source.sampler_problem + "; the image is repeated");
    if (source.image >= 0) {
      const auto found = std::ranges::find(result_.images, source.image);
      source.material.image = static_cast<uint32_t>(found - result_.images.begin());
      if (found == result_.images.end()) result_.images.push_back(source.image);
    }
    append(source.material, source.transform);
    texcoords_.push_back(source.texcoord);
    only_emits_.push_back(source.only_emits);
  }

  uint32_t append(const Material& material, const TextureTransform& transform) {
    document_.charge.add(2 * (sizeof(Material) + sizeof(TextureTransform)) + material.name.size());
    result_.materials.push_back(material);
    result_.transforms.push_back(transform);
    return static_cast<uint32_t>(result_.materials.size()) - 1;
  }

  void resolve(Primitive& primitive) {
    PrimitiveSurface& surface = primitive.surface;
    surface.color = primitive.color;
    int set = 0;
    if (primitive.material >= 0 && static_cast<size_t>(primitive.material) < texcoords_.size()) {
      surface.material = static_cast<uint32_t>(primitive.material);
      if (only_emits_[surface.material]) surface.color = -1;
      if (result_.materials[surface.material].image != Material::kNoImage) {
        set = texcoords_[surface.material];
        surface.texture_coordinates = texture_coordinates(primitive, set);
      }
    } else {
      if (primitive.material >= 0)
        warn("missing-material", where_,
             "material " + std::to_string(primitive.material) +
                 " does not exist; the primitive is white");
      else if (primitive.material == Primitive::kBrokenMaterial)
        warn("missing-material", where_,
             "its material is not a whole number, expected the index of a material; the primitive "
             "is white");
      surface.material = plain_material();
    }
    place_draco_surface(document_, primitive, set);
    const uint64_t vertices = accessor(primitive.position).count;
    check(surface.color, color_use(surface.color), vertices);
    check(surface.texture_coordinates, texture_coordinate_use(set), vertices);
    if (surface.texture_coordinates < 0 &&
        result_.materials[surface.material].image != Material::kNoImage)
      surface.material = without_image(surface.material);
  }

  int texture_coordinates(const Primitive& primitive, int set) {
    const std::vector<int>& sets = primitive.texture_coordinates;
    if (static_cast<size_t>(set) < sets.size()) return sets[static_cast<size_t>(set)];
    warn("missing-texture-coordinates", where_,
         "has no TEXCOORD_" + std::to_string(set) + ", which material " +
             numbered(primitive.material,
                      result_.materials[static_cast<size_t>(primitive.material)].name) +
             " needs; its base color factor is used alone");
    return -1;
  }

  const Accessor& accessor(int index) const {
    return document_.accessors[static_cast<size_t>(index)];
  }

  // Returns the types that the color accessor `index` may have. Three and four components are
  // allowed. `index` may be out of range.
  AccessorUse color_use(int index) const {
    const bool exists = index >= 0 && static_cast<size_t>(index) < document_.accessors.size();
    return {where_ + ": COLOR_0",
            exists && accessor(index).components == 3 ? 3 : 4,
            {kFloat, kUnsignedByte, kUnsignedShort},
            {kUnsignedByte, kUnsignedShort}};
  }
  // Returns the types that an accessor of texture coordinates may have. Signed numbers are allowed
  // by KHR_mesh_quantization.
  AccessorUse texture_coordinate_use(int set) const {
    return {where_ + ": TEXCOORD_" + std::to_string(set),
            2,
            {kFloat, kByte, kUnsignedByte, kShort, kUnsignedShort},
            {kByte, kUnsignedByte, kShort, kUnsignedShort}};
  }

  // If the accessor cannot be read, adds a warning and sets `index` to -1.
  void check(int& index, const AccessorUse& use, uint64_t vertices) {
    try {
      check_accessor(document_, index, use);
      check_count(document_, index, vertices, use.where);
    } catch (const Error& error) {
      index = -1;
      const std::string prefix = document_.path + ": ";
      const std::string& message = error.message();
      warn("unusable-attribute", "",
           message.substr(message.starts_with(prefix) ? prefix.size() : 0) + "; it is left out");
    }
  }

  uint32_t plain_material() {
    if (!plain_) plain_ = append(Material{}, {});
    return *plain_;
  }

  uint32_t without_image(uint32_t material) {
    const auto [place, is_new] = without_image_.try_emplace(material, 0);
    if (is_new) {
      Material factor_alone = result_.materials[material];
      factor_alone.image = Material::kNoImage;
      place->second = append(factor_alone, {});
    }
    return place->second;
  }

  void warn(const char* code, const std::string& place, const std::string& message) {
    result_.warnings.add({code, document_.path + (place.empty() ? "" : ": " + place), message});
  }

  Document& document_;
  DocumentMaterials result_;
  // For each of the file's materials: the n of its TEXCOORD_n, and MaterialSource::only_emits.
  std::vector<int> texcoords_;
  std::vector<bool> only_emits_;
  std::optional<uint32_t> plain_;
  std::map<uint32_t, uint32_t> without_image_;
  std::string where_;
};

}  // namespace

void resolve_materials(Document& document) { MaterialResolver(document).resolve(); }

}  // namespace voxdag::gltf
