// Presents a mesh in memory as a scene file. MeshFiles is a file system with one additional path,
// under which it provides the mesh as a PLY file. All other paths refer to the underlying file
// system. The build reads the PLY file in parts, like every scene file. Each read generates the
// requested bytes from the mesh.
#pragma once

#include <memory>
#include <string>

#include "core/io/forwarding_files.h"
#include "voxdag/mesh.h"

namespace voxdag {

class MeshFiles : public ForwardingFiles {
 public:
  // The path of the mesh, as used in messages.
  static constexpr const char* kPath = "mesh in memory";

  // Throws Error{kInvalidInput} for arrays of wrong lengths. The mesh's arrays must outlive this
  // object and its files.
  MeshFiles(FileSystem& files, const Mesh& mesh);

  // Opens the mesh or another file. The mesh has no known identity, so no build relies on data from
  // an earlier read of it.
  std::unique_ptr<ReadableFile> open_read(const std::string& path) override;
  bool exists(const std::string& path) override;

 private:
  const Mesh mesh_;
};

}  // namespace voxdag
