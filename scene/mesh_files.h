// Presents meshes in memory as scene files. MeshFiles is a file system that adds paths to another
// file system: one for each mesh, for each texture and for each scene file in memory. All other
// paths refer to the underlying file system. A mesh has the form of a PLY file. The build reads
// this file in parts, like every scene file. Each read generates the requested bytes from the mesh.
#pragma once

#include <map>
#include <memory>
#include <span>
#include <string>

#include "core/io/forwarding_files.h"
#include "voxdag/mesh.h"

namespace voxdag {

class MeshFiles : public ForwardingFiles {
 public:
  // The path of a single mesh, as used in messages.
  static constexpr const char* kPath = "mesh in memory";

  // The arrays of the meshes must outlive this object and its files.
  explicit MeshFiles(FileSystem& files) : ForwardingFiles(files) {}
  MeshFiles(FileSystem& files, const Mesh& mesh) : ForwardingFiles(files) { add(kPath, mesh); }

  // Adds a mesh under a path without '/'. Throws Error{kInvalidInput} if an array has a wrong
  // length, or if the name of a texture is empty or has a slash, backslash, colon, double quote or
  // line end.
  void add(const std::string& path, const Mesh& mesh);

  // Adds a scene file whose bytes are in memory.
  void add_file(const std::string& path, std::span<const std::byte> bytes);

  // Opens a mesh, a file in memory or another file. Meshes and files in memory have no known
  // identity, so no build relies on data from an earlier read of them.
  std::unique_ptr<ReadableFile> open_read(const std::string& path) override;
  bool exists(const std::string& path) override;

 private:
  std::map<std::string, Mesh> meshes_;
  std::map<std::string, std::span<const std::byte>> bytes_;  // contents of textures and scene files
};

}  // namespace voxdag
