// The first of the two passes over a generated scene: the layout of the .glb and the JSON that
// describes it.
//
//     header 12 | JSON chunk: head 8, text padded with spaces | BIN chunk: head 8, blocks
//     mesh, part:  positions (12 bytes per vertex) | colors (4 bytes each), if there are some |
//                  indices (2 bytes each), padded to 4
//     instances:   translations (12 bytes each)    | scales (12 bytes each)
//
// The numbers are bytes. Array i of the file is bufferView i and accessor i.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "scene/generate/scene_builder.h"
#include "scene/glb_file.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

class GlbLayout : public BlockSink {
 public:
  // mesh() advances `progress` by the mesh's number of triangles; part() and instances() do not.
  GlbLayout(Progress& progress, const CancelToken& cancel) : progress_(progress), cancel_(cancel) {}
  void mesh(const MeshBuilder& mesh) override;
  void part(const MeshBuilder& mesh) override;
  void instances(uint32_t part, std::span<const Float3> translations,
                 std::span<const Float3> scales) override;

  // Returns the text of the JSON chunk. `generator` becomes the asset's generator. `materials` are
  // the materials of meshes; empty without colors.
  std::string json_text(const std::string& generator,
                        std::span<const SceneMaterial> materials) const;
  uint64_t bin_bytes() const { return bin_bytes_; }
  uint64_t triangles() const { return triangles_; }
  uint64_t stored_triangles() const { return stored_triangles_; }
  uint64_t instance_count() const { return instance_count_; }

 private:
  enum class Kind : uint8_t { kMesh, kPart, kInstances };
  struct Block {
    Kind kind;
    uint32_t part;    // number of the part that a block of instances places
    uint32_t first;   // number of vertices or of instances
    uint32_t second;  // number of indices
    Float3 low, high;
    uint32_t material = 0;
    bool has_colors = false;
  };
  void add_geometry(Kind kind, const MeshBuilder& mesh);
  void add_bytes(uint64_t bytes);

  Progress& progress_;
  const CancelToken& cancel_;
  std::vector<Block> blocks_;
  std::vector<uint64_t> part_triangles_;
  uint64_t bin_bytes_ = 0;
  uint64_t triangles_ = 0;
  uint64_t stored_triangles_ = 0;
  uint64_t instance_count_ = 0;
};

// Returns the size in bytes of an array of `count` indices in the file, padding included.
inline uint64_t padded_index_bytes(uint64_t count) { return (2 * count + 3) / 4 * 4; }

}  // namespace voxdag
