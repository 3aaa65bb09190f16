// Writes the materials of an assimp scene, with their images, to a .glb.
#pragma once

#include <assimp/material.h>

#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/base/warning.h"
#include "core/io/file_system.h"
#include "scene/glb_arrays.h"
#include "scene/glb_file.h"
#include "scene/import/assimp_scene.h"

namespace voxdag {

class MaterialExport {
 public:
  // Warns about images that cannot be used, and about other properties that are left out. The
  // arguments must outlive this object.
  MaterialExport(const AssimpScene& scene, FileSystem& files, WarningList& warnings);

  size_t image_count() const { return images_.size(); }
  // Returns the paths of the images that are not embedded in the scene file.
  std::vector<std::string> image_files() const;
  // Returns the set of texture coordinates that a material uses.
  unsigned uv_channel(unsigned material) const { return uv_channels_[material]; }
  // Adds the materials, textures, samplers and images to the root of the .glb, and the images to
  // the arrays.
  void add_to(nlohmann::json& root, GlbArrays& arrays) const;
  // Writes the images in the order in which add_to() added them.
  void write(GlbFile& file) const;

 private:
  struct Image {
    std::string name;
    const char* type = "";               // its media type
    std::string extension;               // the glTF extension that the format needs, or ""
    std::string bytes;                   // bytes of an image that is embedded in the scene file
    std::unique_ptr<ReadableFile> file;  // file of an image that is not embedded
    uint64_t size() const { return file ? file->size() : bytes.size(); }
  };

  void add(const aiMaterial& material);
  std::optional<nlohmann::json> add_texture(const aiMaterial& material, aiTextureType type,
                                            const std::string& path, const std::string& where);
  void set_alpha(const aiMaterial& material, const std::string& image, const std::string& where,
                 double opacity, nlohmann::json& out);
  std::optional<size_t> find_image(const std::string& path, const std::string& where);
  Image open_image(const std::string& path) const;

  const AssimpScene& scene_;
  FileSystem& files_;
  WarningList& warnings_;
  std::vector<unsigned> uv_channels_;
  std::vector<Image> images_;
  std::map<std::string, std::optional<size_t>> image_numbers_;  // keyed by path; nullopt: unusable
  nlohmann::json materials_ = nlohmann::json::array(), textures_ = nlohmann::json::array(),
                 samplers_ = nlohmann::json::array();
};

}  // namespace voxdag
