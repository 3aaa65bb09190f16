#include "scene/gltf/materials/material_reader.h"

#include <algorithm>
#include <array>
#include <climits>
#include <cmath>

#include "scene/gltf/document/tinygltf.h"
#include "scene/surface_numbers.h"

namespace voxdag::gltf {
namespace {

// A reference to a texture, in a material or in an extension.
struct TextureUse {
  int texture = -1;
  int texcoord = 0;
  TextureTransform transform;
};

int whole_number_or(const tinygltf::Value& object, const char* key, int otherwise) {
  if (!object.Has(key) || !object.Get(key).IsNumber()) return otherwise;
  const double value = object.Get(key).GetNumberAsDouble();
  return value >= 0 && value <= INT_MAX && value == std::floor(value) ? static_cast<int>(value)
                                                                      : otherwise;
}

double number_or(const tinygltf::Value& object, const char* key, double otherwise) {
  if (!object.Has(key) || !object.Get(key).IsNumber()) return otherwise;
  return object.Get(key).GetNumberAsDouble();
}

template <size_t N>
std::array<double, N> numbers_or(const tinygltf::Value& object, const char* key,
                                 std::array<double, N> otherwise) {
  if (!object.Has(key)) return otherwise;
  const tinygltf::Value& array = object.Get(key);
  if (array.ArrayLen() != N) return otherwise;
  std::array<double, N> numbers;
  for (size_t i = 0; i < N; ++i) {
    const tinygltf::Value& number = array.Get(static_cast<int>(i));
    if (!number.IsNumber()) return otherwise;
    numbers[i] = number.GetNumberAsDouble();
  }
  return numbers;
}

void read_transform(const tinygltf::Value& extension, TextureUse& use) {
  use.transform = make_texture_transform(numbers_or<2>(extension, "offset", {0, 0}),
                                         number_or(extension, "rotation", 0),
                                         numbers_or<2>(extension, "scale", {1, 1}));
  use.texcoord = whole_number_or(extension, "texCoord", use.texcoord);
}

TextureUse read_use(const tinygltf::TextureInfo& info) {
  TextureUse use{info.index, info.texCoord, {}};
  const auto transform = info.extensions.find("KHR_texture_transform");
  if (transform != info.extensions.end()) read_transform(transform->second, use);
  return use;
}

// Reads a reference inside an extension.
TextureUse read_use(const tinygltf::Value& info) {
  TextureUse use{whole_number_or(info, "index", -1), whole_number_or(info, "texCoord", 0), {}};
  if (info.Has("extensions") && info.Get("extensions").Has("KHR_texture_transform"))
    read_transform(info.Get("extensions").Get("KHR_texture_transform"), use);
  return use;
}

Wrap wrap_of(int mode) {
  if (mode == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE) return Wrap::kClampToEdge;
  return mode == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT ? Wrap::kMirroredRepeat : Wrap::kRepeat;
}

// Returns the texture's image. If it has none, returns the image that an extension gives in a file
// format such as WebP, or -1.
int image_of(const tinygltf::Texture& texture) {
  if (texture.source >= 0) return texture.source;
  for (const char* name :
       {"EXT_texture_webp", "KHR_texture_basisu", "MSFT_texture_dds", "EXT_texture_avif"}) {
    const auto extension = texture.extensions.find(name);
    if (extension == texture.extensions.end()) continue;
    const int image = whole_number_or(extension->second, "source", -1);
    if (image >= 0) return image;
  }
  return -1;
}

template <class T>
bool exists(const std::vector<T>& all, int index) {
  return index >= 0 && static_cast<size_t>(index) < all.size();
}

void read_texture(const tinygltf::Model& model, const TextureUse& use, MaterialSource& out) {
  if (use.texture < 0) return;
  const std::string name = "its base color texture " + std::to_string(use.texture);
  if (!exists(model.textures, use.texture)) {
    out.problem = name + " does not exist";
    return;
  }
  const tinygltf::Texture& texture = model.textures[static_cast<size_t>(use.texture)];
  const int image = image_of(texture);
  if (!exists(model.images, image)) {
    out.problem =
        name + (image < 0 ? " has no image"
                          : " is of image " + std::to_string(image) + ", which does not exist");
    return;
  }
  out.image = image;
  out.texcoord = use.texcoord;
  out.transform = use.transform;
  if (!exists(model.samplers, texture.sampler)) return;
  const tinygltf::Sampler& sampler = model.samplers[static_cast<size_t>(texture.sampler)];
  out.material.wrap = {wrap_of(sampler.wrapS), wrap_of(sampler.wrapT)};
}

}  // namespace

MaterialSource read_material(const tinygltf::Model& model, int index) {
  const tinygltf::Material& in = model.materials[static_cast<size_t>(index)];
  MaterialSource out;
  out.material.name = in.name;
  out.material.alpha_mode = in.alphaMode == "MASK"    ? AlphaMode::kMask
                            : in.alphaMode == "BLEND" ? AlphaMode::kBlend
                                                      : AlphaMode::kOpaque;
  out.material.alpha_cutoff = intensity_of(in.alphaCutoff);
  std::array<double, 4> factor{1, 1, 1, 1};
  TextureUse use;
  const auto glossiness = in.extensions.find("KHR_materials_pbrSpecularGlossiness");
  if (glossiness != in.extensions.end()) {
    factor = numbers_or<4>(glossiness->second, "diffuseFactor", factor);
    if (glossiness->second.Has("diffuseTexture"))
      use = read_use(glossiness->second.Get("diffuseTexture"));
  } else {
    const std::vector<double>& given = in.pbrMetallicRoughness.baseColorFactor;
    if (given.size() == factor.size()) std::copy(given.begin(), given.end(), factor.begin());
    use = read_use(in.pbrMetallicRoughness.baseColorTexture);
  }
  for (size_t c = 0; c < factor.size(); ++c) out.material.factor[c] = intensity_of(factor[c]);
  read_texture(model, use, out);
  return out;
}

}  // namespace voxdag::gltf
