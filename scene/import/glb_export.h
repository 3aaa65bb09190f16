// Writes an assimp scene as a .glb.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/base/warning.h"
#include "core/io/file_system.h"
#include "scene/import/assimp_scene.h"
#include "scene/import/import.h"
#include "scene/import/material_export.h"
#include "scene/import/mesh_export.h"

namespace voxdag {

class GlbExport {
 public:
  static constexpr const char* kGenerator = "voxdag import";

  // Adds warnings about parts that are left out. Throws Error{kInvalidInput} for an invalid mesh or
  // transform, or a scene without triangles. The arguments must outlive this object.
  GlbExport(const AssimpScene& scene, FileSystem& files, WarningList& warnings);

  // Returns the report. Its number of bytes is known only after write().
  const ImportReport& report() const { return report_; }
  // Returns the paths of the images that write() copies from other files.
  std::vector<std::string> image_files() const { return materials_.image_files(); }
  // Writes "<path>.partial". Calls advance(triangles) after each mesh. Throws Error.
  void write(const std::string& path, MemoryBudget& budget,
             const std::function<void(uint64_t)>& advance);

 private:
  void add_meshes(GlbArrays& arrays);
  nlohmann::json nodes();
  void warn_of_unused_meshes();
  nlohmann::json node_of(const aiNode& node);
  std::optional<size_t> mesh_of(const aiNode& node);

  const AssimpScene& scene_;
  FileSystem& files_;
  WarningList& warnings_;
  MaterialExport materials_;
  std::vector<MeshExport> meshes_;
  std::vector<nlohmann::json> primitives_;  // one per assimp mesh; null if it has no triangles
  // The meshes of the .glb, keyed by the assimp meshes that they consist of.
  std::map<std::vector<unsigned>, size_t> mesh_numbers_;
  nlohmann::json glb_meshes_ = nlohmann::json::array();
  nlohmann::json root_;
  uint64_t bin_bytes_ = 0;
  ImportReport report_;
};

}  // namespace voxdag
