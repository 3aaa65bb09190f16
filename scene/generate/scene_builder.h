// Collects the pieces of a scene from its generator into blocks of bounded size: meshes with 16-bit
// indices, parts that are stored once, and instances of parts. Not thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "scene/generate/generate.h"
#include "scene/generate/mesh_builder.h"

namespace voxdag {

// Receives the blocks of a scene in the order in which the file stores them.
class BlockSink {
 public:
  virtual ~BlockSink() = default;
  // Receives 1 to MeshBuilder::kMaxTriangles triangles in world space.
  virtual void mesh(const MeshBuilder& mesh) = 0;
  // Receives the next part. Parts are numbered from 0 and precede their instances.
  virtual void part(const MeshBuilder& mesh) = 0;
  // Receives instances of one part. Each maps p to p * scale + translation.
  virtual void instances(uint32_t part, std::span<const Float3> translations,
                         std::span<const Float3> scales) = 0;
};

class SceneBuilder {
 public:
  // If `instances` is false, parts are copied triangle by triangle to each place. If `colors` is
  // true, each material has separate meshes.
  SceneBuilder(BlockSink& sink, bool instances, bool colors);
  bool has_colors() const { return colors_; }

  // Sets the material and color of the following additions. Has no effect without colors.
  void paint(uint32_t material, const Rgba8& color) { paint_ = {material, color}; }

  // Returns a mesh of the current paint with space for `vertices` and `triangles` more. This is the
  // current mesh if it has the space. Otherwise the current mesh is passed to the sink, and an
  // empty mesh is returned. The arguments are at most MeshBuilder::kMaxVertices and
  // MeshBuilder::kMaxTriangles.
  MeshBuilder& mesh_for(uint32_t vertices, uint32_t triangles);
  uint32_t add_part(MeshBuilder mesh);
  // Places a part. Its colors are multiplied by the current paint's color.
  void place(uint32_t part, const Vec3& translation, const Vec3& scale);
  // Passes the incomplete blocks to the sink.
  void finish();

 private:
  struct Part {
    MeshBuilder mesh;
    std::vector<Float3> translations, scales;
  };
  struct Paint {
    uint32_t material = 0;
    Rgba8 color = kWhite;
  };
  static constexpr size_t kInstancesPerBlock = 32768;
  static constexpr uint32_t kMaxMaterials = 4;

  void place_triangles(const MeshBuilder& part, const Vec3& translation, const Vec3& scale);
  void flush_mesh(MeshBuilder& mesh);
  void flush_instances(uint32_t part);

  BlockSink& sink_;
  const bool instances_, colors_;
  Paint paint_;
  // One mesh per material. Without colors only the first mesh is used.
  std::array<MeshBuilder, kMaxMaterials> meshes_;
  std::vector<Part> parts_;
};

// Defined in city.cc.
extern const std::array<SceneMaterial, 4> kCityMaterials;

// The generators, one file each. A generator must make the same calls if it runs again with the
// same options, because generate_scene() runs it twice.
void make_city(const GenerateOptions& options, SceneBuilder& scene);
void make_menger(const GenerateOptions& options, SceneBuilder& scene);
void make_terrain(const GenerateOptions& options, SceneBuilder& scene);
void make_soup(const GenerateOptions& options, SceneBuilder& scene);
void make_spheres(const GenerateOptions& options, SceneBuilder& scene);

}  // namespace voxdag
