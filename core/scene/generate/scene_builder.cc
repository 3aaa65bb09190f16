#include "core/scene/generate/scene_builder.h"

#include <utility>

namespace voxdag {

Mesh& SceneBuilder::mesh_for(uint32_t vertices, uint32_t triangles) {
  if (mesh_.vertices() + vertices > Mesh::kMaxVertices ||
      mesh_.triangles() + triangles > Mesh::kMaxTriangles)
    flush_mesh();
  return mesh_;
}

uint32_t SceneBuilder::add_part(Mesh mesh) {
  if (instances_) sink_.part(mesh);
  parts_.push_back({std::move(mesh), {}, {}});
  return static_cast<uint32_t>(parts_.size() - 1);
}

void SceneBuilder::place(uint32_t part, const Vec3& translation, const Vec3& scale) {
  Part& p = parts_[part];
  if (!instances_) return place_triangles(p.mesh, translation, scale);
  p.translations.push_back(rounded(translation));
  p.scales.push_back(rounded(scale));
  if (p.scales.size() == kInstancesPerBlock) flush_instances(part);
}

void SceneBuilder::place_triangles(const Mesh& part, const Vec3& translation, const Vec3& scale) {
  Mesh& mesh = mesh_for(part.vertices(), part.triangles());
  const uint32_t first = mesh.vertices();
  for (const Float3& p : part.positions)
    mesh.add_vertex({p[0] * scale.x + translation.x, p[1] * scale.y + translation.y,
                     p[2] * scale.z + translation.z});
  for (uint16_t i : part.indices) mesh.indices.push_back(static_cast<uint16_t>(first + i));
}

void SceneBuilder::flush_mesh() {
  if (mesh_.triangles() > 0) sink_.mesh(mesh_);
  mesh_.positions.clear();
  mesh_.indices.clear();
}

void SceneBuilder::flush_instances(uint32_t part) {
  Part& p = parts_[part];
  if (!p.scales.empty()) sink_.instances(part, p.translations, p.scales);
  p.translations.clear();
  p.scales.clear();
}

void SceneBuilder::finish() {
  flush_mesh();
  for (uint32_t i = 0; i < parts_.size(); ++i) flush_instances(i);
}

}  // namespace voxdag
