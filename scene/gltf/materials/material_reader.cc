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

// Reads a texture reference (glTF textureInfo) that is a member of a material extension, given as
// JSON because tinygltf does not parse extensions.
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

template <class T>
bool exists(const std::vector<T>& all, int index) {
  return index >= 0 && static_cast<size_t>(index) < all.size();
}

// Returns the index of the texture's image. If the model has no image with this index, returns the
// index in the first extension (for another image format) whose image exists. If none exists,
// returns the last index that was found, which is not in the model.
int image_of(const tinygltf::Model& model, const tinygltf::Texture& texture) {
  int image = texture.source;
  for (const char* name :
       {"EXT_texture_webp", "EXT_texture_avif", "KHR_texture_basisu", "MSFT_texture_dds"}) {
    if (exists(model.images, image)) break;
    const auto extension = texture.extensions.find(name);
    if (extension != texture.extensions.end())
      image = whole_number_or(extension->second, "source", image);
  }
  return image;
}

// Sets the image and the texture coordinates of `out` from a texture. `kind` is the purpose of the
// texture, for messages.
void read_texture(const tinygltf::Model& model, const TextureUse& use, const char* kind,
                  MaterialSource& out) {
  if (use.texture < 0) return;
  const std::string name = std::string("its ") + kind + " texture " + std::to_string(use.texture);
  if (!exists(model.textures, use.texture)) {
    out.problem = name + " does not exist";
    return;
  }
  const tinygltf::Texture& texture = model.textures[static_cast<size_t>(use.texture)];
  const int image = image_of(model, texture);
  if (!exists(model.images, image)) {
    out.problem =
        name + (image < 0 ? " has no image"
                          : " is of image " + std::to_string(image) + ", which does not exist");
    return;
  }
  out.image = image;
  out.texcoord = use.texcoord;
  out.transform = use.transform;
  if (!exists(model.samplers, texture.sampler)) {
    if (texture.sampler >= 0)
      out.sampler_problem =
          name + " has sampler " + std::to_string(texture.sampler) + ", which does not exist";
    return;
  }
  const tinygltf::Sampler& sampler = model.samplers[static_cast<size_t>(texture.sampler)];
  out.material.wrap = {wrap_of(sampler.wrapS), wrap_of(sampler.wrapT)};
}

// The light that a material emits.
struct Emission {
  std::array<double, 3> factor{};
  TextureUse use;
};

Emission read_emission(const tinygltf::Material& in) {
  Emission emission;
  if (in.extensions.contains("KHR_materials_unlit")) return emission;
  const auto extension = in.extensions.find("KHR_materials_emissive_strength");
  double strength = 1;
  if (extension != in.extensions.end())
    strength = number_or(extension->second, "emissiveStrength", strength);
  if (in.emissiveFactor.size() == emission.factor.size())
    for (size_t c = 0; c < emission.factor.size(); ++c)
      emission.factor[c] = in.emissiveFactor[c] * strength;
  emission.use = read_use(in.emissiveTexture);
  return emission;
}

template <size_t N>
bool is_black(const std::array<double, N>& factor) {
  return std::all_of(factor.begin(), factor.begin() + 3,
                     [](double c) { return intensity_of(c) == 0; });
}

// Replaces a black base color by the emitted light. The alpha modes MASK and BLEND take alpha from
// the base color texture. So for these modes, nothing is replaced if the textures of the base color
// and of the emitted light differ.
void use_emission(const tinygltf::Material& in, std::array<double, 4>& factor, TextureUse& use,
                  MaterialSource& out) {
  const Emission emission = read_emission(in);
  if (!is_black(factor) || is_black(emission.factor)) return;
  const bool is_opaque = out.material.alpha_mode == AlphaMode::kOpaque;
  if (!is_opaque && emission.use.texture != use.texture) return;
  std::copy(emission.factor.begin(), emission.factor.end(), factor.begin());
  use = emission.use;
  out.only_emits = true;
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
  use_emission(in, factor, use, out);
  // No alpha reaches a cutoff above 1, so everything is hidden. alpha_cutoff cannot be above 1, so
  // alpha becomes 0 instead.
  if (out.material.alpha_mode == AlphaMode::kMask && in.alphaCutoff > 1) factor[3] = 0;
  for (size_t c = 0; c < factor.size(); ++c) out.material.factor[c] = intensity_of(factor[c]);
  read_texture(model, use, out.only_emits ? "emissive" : "base color", out);
  return out;
}

}  // namespace voxdag::gltf
