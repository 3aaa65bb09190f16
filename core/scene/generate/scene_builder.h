// Collects the pieces of a scene from its generator into blocks of bounded size: meshes with 16-bit
// indices, parts that are stored once, and instances of parts. Not thread-safe.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/scene/generate/generate.h"
#include "core/scene/generate/mesh.h"

namespace voxdag {

// Receives blocks in the order of the file.
class BlockSink {
 public:
  virtual ~BlockSink() = default;
  // 1 to Mesh::kMaxTriangles triangles in world space.
  virtual void mesh(const Mesh& mesh) = 0;
  // The next part, numbered from 0; precedes its instances.
  virtual void part(const Mesh& mesh) = 0;
  // Instances of one part, each of which maps p to p * scale + translation.
  virtual void instances(uint32_t part, std::span<const Float3> translations,
                         std::span<const Float3> scales) = 0;
};

class SceneBuilder {
 public:
  // Without `instances`, parts are copied triangle by triangle to each place.
  SceneBuilder(BlockSink& sink, bool instances) : sink_(sink), instances_(instances) {}

  // A mesh that `vertices` and `triangles` more fit into: the current one, or an empty one after it
  // was passed to the sink. At most Mesh::kMaxVertices and Mesh::kMaxTriangles.
  Mesh& mesh_for(uint32_t vertices, uint32_t triangles);
  uint32_t add_part(Mesh mesh);
  void place(uint32_t part, const Vec3& translation, const Vec3& scale);
  // Passes the incomplete blocks to the sink.
  void finish();

 private:
  struct Part {
    Mesh mesh;
    std::vector<Float3> translations, scales;
  };
  static constexpr size_t kInstancesPerBlock = 32768;

  void place_triangles(const Mesh& part, const Vec3& translation, const Vec3& scale);
  void flush_mesh();
  void flush_instances(uint32_t part);

  BlockSink& sink_;
  const bool instances_;
  Mesh mesh_;
  std::vector<Part> parts_;
};

// The generators, one file each. A generator that runs again with the same options makes the same
// calls: generate_scene() runs it twice.
void make_city(const GenerateOptions& options, SceneBuilder& scene);
void make_menger(const GenerateOptions& options, SceneBuilder& scene);
void make_terrain(const GenerateOptions& options, SceneBuilder& scene);
void make_soup(const GenerateOptions& options, SceneBuilder& scene);
void make_spheres(const GenerateOptions& options, SceneBuilder& scene);

}  // namespace voxdag
