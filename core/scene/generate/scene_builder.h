// Takes a scene from its generator piece by piece and hands it on in blocks of bounded size: meshes
// with 16-bit indices, parts that are stored once, and instances of parts.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/scene/generate/mesh.h"

namespace voxdag {

// Takes blocks in the order in which they lie in the file.
class BlockSink {
 public:
  virtual ~BlockSink() = default;
  // Triangles where they are: 1 to Mesh::kMaxTriangles.
  virtual void mesh(const Mesh& mesh) = 0;
  // Part 0, 1, ...; comes before its instances.
  virtual void part(const Mesh& mesh) = 0;
  // Instances of one part, each p -> p * scale + translation.
  virtual void instances(uint32_t part, std::span<const Float3> translations,
                         std::span<const Float3> scales) = 0;
};

class SceneBuilder {
 public:
  // Without `instances` parts are written out triangle by triangle wherever they are placed.
  SceneBuilder(BlockSink& sink, bool instances) : sink_(sink), instances_(instances) {}

  // The current mesh, with room for these many more; a full one is handed on first. At most a
  // whole mesh's vertices and triangles.
  Mesh& room(uint32_t vertices, uint32_t triangles);
  uint32_t add_part(Mesh mesh);
  void place(uint32_t part, const Vec3& translation, const Vec3& scale);
  // Hands on what is left.
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

}  // namespace voxdag
