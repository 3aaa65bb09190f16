// A mesh in memory as a scene file: a file system in which one more path is a PLY file with the
// mesh. All other paths pass through. The build reads it in windows like every scene file, and its
// contents are made on the fly.
#pragma once

#include <memory>
#include <string>

#include "core/io/forwarding_files.h"
#include "voxdag/mesh.h"

namespace voxdag {

class MeshFiles : public ForwardingFiles {
 public:
  // The path of the mesh; messages name it.
  static constexpr const char* kPath = "mesh in memory";

  // Throws Error{kInvalidInput} for arrays of the wrong lengths. The mesh's arrays must outlive
  // this and its files.
  MeshFiles(FileSystem& files, const Mesh& mesh);

  // The identity of the mesh is unknown, so no build trusts an earlier reading of it.
  std::unique_ptr<ReadableFile> open_read(const std::string& path) override;
  bool exists(const std::string& path) override;

 private:
  const Mesh mesh_;
};

}  // namespace voxdag
