#include "scene/import/material_export.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <set>
#include <span>
#include <string_view>
#include <utility>

#include "core/base/error.h"
#include "core/image/image_formats.h"
#include "core/image/png_writer.h"
#include "scene/messages.h"
#include "scene/text/side_files.h"
#include "scene/textures/linear_light.h"

namespace voxdag {
namespace {

using nlohmann::json;

constexpr size_t kCopiedBytes = size_t{1} << 20;

uint64_t padded(uint64_t bytes) { return (bytes + 3) / 4 * 4; }

// An image format that a .glb can contain.
struct MediaType {
  ImageDecoder decoder;
  const char* name;
  const char* extension;  // the glTF extension that the format needs, or ""
};
constexpr MediaType kMediaTypes[] = {
    {ImageDecoder::kPng, "image/png", ""},
    {ImageDecoder::kJpeg, "image/jpeg", ""},
    {ImageDecoder::kWebp, "image/webp", "EXT_texture_webp"},
    {ImageDecoder::kAvif, "image/avif", "EXT_texture_avif"},
};

const MediaType& media_type_of(std::span<const std::byte> begin) {
  const ImageFormat* const format = image_format_of(begin);
  for (const MediaType& type : kMediaTypes)
    if (format && format->decoder == type.decoder) return type;
  throw Error(ErrorCode::kInvalidInput,
              std::string("it is ") + (format ? format->name : "of an unknown format") +
                  ", expected PNG, JPEG, WebP or AVIF; convert it with: magick IN OUT.png");
}

int wrap_mode(int mode) {
  if (mode == aiTextureMapMode_Mirror) return 33648;
  return mode == aiTextureMapMode_Clamp || mode == aiTextureMapMode_Decal ? 33071 : 10497;
}

// Encodes an embedded image that assimp stores as plain pixels to PNG.
std::string encode(const aiTexture& texture) {
  std::vector<uint8_t> rgba;
  for (const aiTexel& pixel : std::span(texture.pcData, size_t{texture.mWidth} * texture.mHeight))
    rgba.insert(rgba.end(), {pixel.r, pixel.g, pixel.b, pixel.a});
  return encode_png(texture.mWidth, texture.mHeight, rgba);
}

// Returns the color of a material without an image, in linear light. A base color is already
// linear. A diffuse color is converted from sRGB, because most programs display it without
// conversion.
std::array<double, 3> color_of(const aiMaterial& material) {
  aiColor4D color(1, 1, 1, 1);
  if (material.Get(AI_MATKEY_BASE_COLOR, color) == AI_SUCCESS)
    return {double(color.r), double(color.g), double(color.b)};
  material.Get(AI_MATKEY_COLOR_DIFFUSE, color);
  std::array<double, 3> linear;
  for (unsigned i = 0; i < 3; ++i) {
    const double channel = std::clamp(double(color[i]), 0.0, 1.0);
    linear[i] = channel > 0 ? linear_light(channel) / 65535.0 : 0;
  }
  return linear;
}

std::string path_of(const aiMaterial& material, aiTextureType type) {
  aiString path;
  if (material.GetTextureCount(type) == 0 || material.GetTexture(type, 0, &path) != AI_SUCCESS)
    return "";
  return text_of(path);
}

template <class T>
T property_of(const aiMaterial& material, const char* key, unsigned type, unsigned index,
              T otherwise) {
  T value = otherwise;
  return material.Get(key, type, index, value) == AI_SUCCESS ? value : otherwise;
}

}  // namespace

MaterialExport::MaterialExport(const AssimpScene& scene, FileSystem& files, WarningList& warnings)
    : scene_(scene), files_(files), warnings_(warnings) {
  for (unsigned i = 0; i < scene->mNumMaterials; ++i) add(*scene->mMaterials[i]);
}

void MaterialExport::add(const aiMaterial& material) {
  const std::string name = text_of(const_cast<aiMaterial&>(material).GetName());
  const std::string where = scene_.path() + ": material " +
                            numbered(static_cast<int>(materials_.size()), printable(name));
  const bool is_pbr = material.GetTextureCount(aiTextureType_BASE_COLOR) > 0;
  const aiTextureType type = is_pbr ? aiTextureType_BASE_COLOR : aiTextureType_DIFFUSE;
  const std::string path = path_of(material, type);
  uv_channels_.push_back(
      static_cast<unsigned>(std::max(0, property_of(material, AI_MATKEY_UVWSRC(type, 0), 0))));

  json pbr = {{"metallicFactor", 0}, {"roughnessFactor", 1}};
  const auto texture = path.empty() ? std::nullopt : add_texture(material, type, path, where);
  std::array<double, 3> color = {1, 1, 1};
  if (texture)
    pbr["baseColorTexture"] = *texture;
  else
    color = color_of(material);
  const double opacity = property_of(material, AI_MATKEY_OPACITY, 1.0f);
  json out = {{"name", name}};
  set_alpha(material, path, where, opacity, out);
  pbr["baseColorFactor"] = {color[0], color[1], color[2],
                            opacity > 0 ? std::min(opacity, 1.0) : 1.0};
  out["pbrMetallicRoughness"] = std::move(pbr);
  materials_.push_back(std::move(out));
}

// Sets the alpha mode. An opacity of 0 counts as a mistake of the program that wrote the file, so
// it is ignored.
void MaterialExport::set_alpha(const aiMaterial& material, const std::string& image,
                               const std::string& where, double opacity, json& out) {
  if (!(opacity > 0))
    warnings_.add({"ignored-opacity", where, "its opacity of 0 is ignored; it is opaque"});
  const std::string mask = path_of(material, aiTextureType_OPACITY);
  if (!mask.empty() && mask != image)
    warnings_.add({"ignored-opacity-map", where, "its separate image of the opacity is left out"});
  if ((opacity > 0 && opacity < 1) || (!mask.empty() && mask == image)) out["alphaMode"] = "BLEND";
}

// Returns the reference to a new texture; nullopt if its image cannot be used.
std::optional<json> MaterialExport::add_texture(const aiMaterial& material, aiTextureType type,
                                                const std::string& path, const std::string& where) {
  const auto image = find_image(path, where);
  if (!image) return std::nullopt;
  samplers_.push_back(
      {{"wrapS", wrap_mode(property_of(material, AI_MATKEY_MAPPINGMODE_U(type, 0), 0))},
       {"wrapT", wrap_mode(property_of(material, AI_MATKEY_MAPPINGMODE_V(type, 0), 0))}});
  json texture = {{"sampler", samplers_.size() - 1}};
  if (const std::string extension = images_[*image].extension; !extension.empty())
    texture["extensions"][extension]["source"] = *image;
  else
    texture["source"] = *image;
  textures_.push_back(std::move(texture));
  return json{{"index", textures_.size() - 1}};
}

std::optional<size_t> MaterialExport::find_image(const std::string& path,
                                                 const std::string& where) {
  const auto known = image_numbers_.find(path);
  if (known != image_numbers_.end()) return known->second;
  try {
    images_.push_back(open_image(path));
    return image_numbers_[path] = images_.size() - 1;
  } catch (const Error& error) {
    warnings_.add({"unusable-image", where,
                   "its image " + printable(path) + " is left out: " + error.message()});
    return image_numbers_[path] = std::nullopt;
  }
}

MaterialExport::Image MaterialExport::open_image(const std::string& path) const {
  Image image;
  image.name = path;
  std::array<std::byte, 64> begin{};
  if (const aiTexture* const embedded = scene_->GetEmbeddedTexture(path.c_str())) {
    image.name = text_of(embedded->mFilename);
    image.bytes =
        embedded->mHeight > 0
            ? encode(*embedded)
            : std::string(reinterpret_cast<const char*>(embedded->pcData), embedded->mWidth);
    std::memcpy(begin.data(), image.bytes.data(), std::min(begin.size(), image.bytes.size()));
  } else {
    image.file = open_side_file(files_, scene_.path(), path);
    const auto size = static_cast<size_t>(std::min<uint64_t>(begin.size(), image.file->size()));
    image.file->read_at(0, std::span(begin).first(size));
  }
  const MediaType& type = media_type_of(begin);
  image.type = type.name;
  image.extension = type.extension;
  return image;
}

std::vector<std::string> MaterialExport::image_files() const {
  std::vector<std::string> paths;
  for (const Image& image : images_)
    if (image.file) paths.push_back(image.file->path());
  return paths;
}

void MaterialExport::add_to(json& root, GlbArrays& arrays) const {
  if (!materials_.empty()) root["materials"] = materials_;
  for (const Image& image : images_) {
    root["images"].push_back(
        {{"name", image.name}, {"mimeType", image.type}, {"bufferView", arrays.views.size()}});
    arrays.add_view(image.size(), padded(image.size()));
  }
  if (!textures_.empty()) root.update({{"textures", textures_}, {"samplers", samplers_}});
  std::set<std::string> extensions;
  for (const Image& image : images_) extensions.insert(image.extension);
  extensions.erase("");
  if (!extensions.empty()) root["extensionsUsed"] = root["extensionsRequired"] = extensions;
}

void MaterialExport::write(GlbFile& file) const {
  const char zeros[4] = {};
  for (const Image& image : images_) {
    file.put(image.bytes.data(), image.bytes.size());
    if (image.file) {
      std::vector<std::byte> piece;
      for (uint64_t at = 0; at < image.file->size(); at += piece.size()) {
        piece.resize(
            static_cast<size_t>(std::min<uint64_t>(kCopiedBytes, image.file->size() - at)));
        image.file->read_at(at, piece);
        file.put(piece.data(), piece.size());
      }
    }
    file.put(zeros, static_cast<size_t>(padded(image.size()) - image.size()));
  }
}

}  // namespace voxdag
