// The second pass over a generated scene: writes the blocks that GlbLayout counted, through one
// buffer. The file has the name "<path>.partial" until finish() renames it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/io/file_system.h"
#include "scene/generate/scene_builder.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

class GlbWriter : public BlockSink {
 public:
  // Writes the header and `json` immediately. Advances `progress` by stored triangles.
  GlbWriter(FileSystem& files, const std::string& path, const std::string& json, uint64_t bin_bytes,
            Progress& progress, const CancelToken& cancel);
  // Removes the partial file unless finish() has returned.
  ~GlbWriter() override;

  void mesh(const MeshBuilder& mesh) override { write_geometry(mesh); }
  void part(const MeshBuilder& mesh) override { write_geometry(mesh); }
  void instances(uint32_t part, std::span<const Float3> translations,
                 std::span<const Float3> scales) override;

  // Syncs the file, renames it and syncs the folder. Returns the size of the file.
  uint64_t finish();

 private:
  void write_geometry(const MeshBuilder& mesh);
  void put(const void* data, size_t bytes);
  void put_u32(uint64_t value);
  void flush();

  FileSystem& files_;
  const std::string path_;
  const uint64_t total_bytes_;
  Progress& progress_;
  const CancelToken& cancel_;
  std::unique_ptr<WritableFile> file_;
  std::vector<std::byte> buffer_;
  uint64_t written_ = 0;
  bool finished_ = false;
};

}  // namespace voxdag
