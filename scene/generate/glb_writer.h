// The second pass over a generated scene: writes the blocks that GlbLayout counted.
#pragma once

#include <cstdint>
#include <string>

#include "core/base/progress.h"
#include "scene/generate/scene_builder.h"
#include "scene/glb_file.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

class GlbWriter : public BlockSink {
 public:
  // Creates the file and writes the header and `json`. mesh() and part() later advance `progress`
  // by the number of triangles that they write.
  GlbWriter(FileSystem& files, const std::string& path, const std::string& json, uint64_t bin_bytes,
            Progress& progress, const CancelToken& cancel)
      : progress_(progress), cancel_(cancel), file_(files, path, json, bin_bytes) {}

  void mesh(const MeshBuilder& mesh) override { write_geometry(mesh); }
  void part(const MeshBuilder& mesh) override { write_geometry(mesh); }
  void instances(uint32_t part, std::span<const Float3> translations,
                 std::span<const Float3> scales) override;

  // Returns the size of the finished file.
  uint64_t finish() { return file_.finish(); }

 private:
  void write_geometry(const MeshBuilder& mesh);

  Progress& progress_;
  const CancelToken& cancel_;
  GlbFile file_;
};

}  // namespace voxdag
