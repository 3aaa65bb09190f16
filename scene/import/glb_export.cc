#include "scene/import/glb_export.h"

#include <cmath>
#include <utility>

#include "core/base/error.h"
#include "core/fields/json_text.h"
#include "scene/messages.h"

namespace voxdag {
namespace {

using nlohmann::json;

constexpr std::array<double, 16> kIdentity = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

std::array<double, 16> columns_of(const aiMatrix4x4& matrix) {
  std::array<double, 16> columns;
  for (unsigned row = 0; row < 4; ++row)
    for (unsigned column = 0; column < 4; ++column)
      columns[4 * column + row] = double{matrix[row][column]};
  return columns;
}

void set_matrix(json& node, const std::array<double, 16>& matrix) {
  if (matrix != kIdentity) node["matrix"] = matrix;
}

}  // namespace

GlbExport::GlbExport(const AssimpScene& scene, FileSystem& files, WarningList& warnings)
    : scene_(scene), files_(files), warnings_(warnings), materials_(scene, files, warnings) {
  GlbArrays arrays;
  add_meshes(arrays);
  if (report_.triangles == 0) refuse(scene.path(), "has no triangles, expected a scene with faces");
  root_ = {{"asset", {{"version", "2.0"}, {"generator", kGenerator}}},
           {"scene", 0},
           {"scenes", {{{"nodes", {0}}}}},
           {"nodes", nodes()}};
  materials_.add_to(root_, arrays);
  bin_bytes_ = arrays.offset;
  root_["meshes"] = std::move(glb_meshes_);
  root_["accessors"] = std::move(arrays.accessors);
  root_["bufferViews"] = std::move(arrays.views);
  root_["buffers"] = {{{"byteLength", bin_bytes_}}};
  report_.materials = scene->mNumMaterials;
  report_.images = materials_.image_count();
}

void GlbExport::add_meshes(GlbArrays& arrays) {
  for (unsigned i = 0; i < scene_->mNumMeshes; ++i) {
    const aiMesh& mesh = *scene_->mMeshes[i];
    const std::string where =
        scene_.path() + ": mesh " + numbered(static_cast<int>(i), printable(text_of(mesh.mName)));
    if (mesh.mMaterialIndex >= scene_->mNumMaterials)
      throw Error(ErrorCode::kInvalidInput,
                  where + " has the material " + std::to_string(mesh.mMaterialIndex) +
                      ", expected less than " + std::to_string(scene_->mNumMaterials) +
                      ", the number of materials");
    const MeshExport& added =
        meshes_.emplace_back(mesh, where, materials_.uv_channel(mesh.mMaterialIndex), warnings_);
    json& primitive = primitives_.emplace_back();
    if (added.triangles() == 0) continue;
    primitive = added.add_to(arrays);
    primitive["material"] = mesh.mMaterialIndex;
    report_.triangles += added.triangles();
    ++report_.meshes;
  }
}

// Returns all nodes. Node 0 is the root; it converts the unit and the axes.
json GlbExport::nodes() {
  json nodes = json::array({{{"children", {1}}}});
  set_matrix(nodes[0], scene_.to_gltf());
  std::vector<const aiNode*> order{scene_->mRootNode};
  for (size_t i = 0; i < order.size(); ++i) {
    json node = node_of(*order[i]);
    for (unsigned c = 0; c < order[i]->mNumChildren; ++c) {
      if (!order[i]->mChildren[c]) continue;  // caused by a bug in assimp's reader of .raw files
      order.push_back(order[i]->mChildren[c]);
      node["children"].push_back(order.size());
    }
    nodes.push_back(std::move(node));
  }
  report_.nodes = nodes.size();
  warn_of_unused_meshes();
  return nodes;
}

void GlbExport::warn_of_unused_meshes() {
  std::vector<bool> is_used(primitives_.size());
  for (const auto& [parts, number] : mesh_numbers_)
    for (const unsigned part : parts) is_used[part] = true;
  for (size_t i = 0; i < primitives_.size(); ++i)
    if (!is_used[i] && !primitives_[i].is_null())
      warnings_.add({"unused-mesh", scene_.path() + ": mesh " + std::to_string(i),
                     "no node has the mesh, so it makes no voxels"});
}

json GlbExport::node_of(const aiNode& node) {
  const std::string name = text_of(node.mName);
  json out = {{"name", name}};
  const auto matrix = columns_of(node.mTransformation);
  for (const double number : matrix)
    if (!std::isfinite(number))
      refuse(scene_.path(), "node \"" + printable(name) +
                                "\" has a transform that is not finite, expected finite numbers");
  set_matrix(out, matrix);
  if (const auto mesh = mesh_of(node)) out["mesh"] = *mesh;
  return out;
}

// Returns the number of a node's mesh in the .glb file, and adds the mesh if it is new. Returns
// nullopt if the node has no triangles.
std::optional<size_t> GlbExport::mesh_of(const aiNode& node) {
  std::vector<unsigned> parts;
  for (unsigned i = 0; i < node.mNumMeshes; ++i) {
    if (node.mMeshes[i] >= primitives_.size())
      refuse(scene_.path(), "node \"" + printable(text_of(node.mName)) + "\" has the mesh " +
                                std::to_string(node.mMeshes[i]) + ", expected less than " +
                                std::to_string(primitives_.size()) + ", the number of meshes");
    if (!primitives_[node.mMeshes[i]].is_null()) parts.push_back(node.mMeshes[i]);
  }
  if (parts.empty()) return std::nullopt;
  const auto [known, is_new] = mesh_numbers_.try_emplace(parts, glb_meshes_.size());
  if (is_new) {
    json mesh = {{"name", text_of(scene_->mMeshes[parts[0]]->mName)}};
    for (const unsigned part : parts) mesh["primitives"].push_back(primitives_[part]);
    glb_meshes_.push_back(std::move(mesh));
  }
  return known->second;
}

void GlbExport::write(const std::string& path, MemoryBudget& budget,
                      const std::function<void(uint64_t)>& advance) {
  GlbFile file(files_, path, json_text(root_), bin_bytes_);
  for (const MeshExport& mesh : meshes_) {
    if (mesh.triangles() == 0) continue;
    mesh.write(file, budget, warnings_);
    advance(mesh.triangles());
  }
  materials_.write(file);
  report_.bytes = file.finish_partial();
}

}  // namespace voxdag
