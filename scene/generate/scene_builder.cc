#include "scene/generate/scene_builder.h"

#include <utility>

namespace voxdag {

namespace {

Rgba8 product(const Rgba8& a, const Rgba8& b) {
  Rgba8 result;
  for (size_t i = 0; i < result.size(); ++i)
    result[i] = static_cast<uint8_t>((a[i] * b[i] + 127) / 255);
  return result;
}

}  // namespace

SceneBuilder::SceneBuilder(BlockSink& sink, bool instances, bool colors)
    : sink_(sink), instances_(instances), colors_(colors) {
  for (uint32_t i = 0; i < kMaxMaterials; ++i) meshes_[i].material = i;
}

MeshBuilder& SceneBuilder::mesh_for(uint32_t vertices, uint32_t triangles) {
  MeshBuilder& mesh = meshes_[colors_ ? paint_.material : 0];
  if (mesh.vertices() + vertices > MeshBuilder::kMaxVertices ||
      mesh.triangles() + triangles > MeshBuilder::kMaxTriangles)
    flush_mesh(mesh);
  if (colors_) mesh.color = paint_.color;
  return mesh;
}

uint32_t SceneBuilder::add_part(MeshBuilder mesh) {
  if (!colors_) mesh.colors.clear();
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

void SceneBuilder::place_triangles(const MeshBuilder& part, const Vec3& translation,
                                   const Vec3& scale) {
  MeshBuilder& mesh = mesh_for(part.vertices(), part.triangles());
  const uint32_t first = mesh.vertices();
  for (size_t i = 0; i < part.positions.size(); ++i) {
    const Float3& p = part.positions[i];
    if (colors_) mesh.color = product(part.colors[i], paint_.color);
    mesh.add_vertex({p[0] * scale.x + translation.x, p[1] * scale.y + translation.y,
                     p[2] * scale.z + translation.z});
  }
  for (uint16_t i : part.indices) mesh.indices.push_back(static_cast<uint16_t>(first + i));
}

void SceneBuilder::flush_mesh(MeshBuilder& mesh) {
  if (mesh.triangles() > 0) sink_.mesh(mesh);
  mesh.positions.clear();
  mesh.colors.clear();
  mesh.indices.clear();
}

void SceneBuilder::flush_instances(uint32_t part) {
  Part& p = parts_[part];
  if (!p.scales.empty()) sink_.instances(part, p.translations, p.scales);
  p.translations.clear();
  p.scales.clear();
}

void SceneBuilder::finish() {
  for (MeshBuilder& mesh : meshes_) flush_mesh(mesh);
  for (uint32_t i = 0; i < parts_.size(); ++i) flush_instances(i);
}

}  // namespace voxdag
