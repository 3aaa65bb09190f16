#include "scene/mesh_files.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <span>

#include "core/base/error.h"

namespace voxdag {
namespace {

[[noreturn]] void refuse_mesh(const std::string& path, const std::string& what) {
  throw Error(ErrorCode::kInvalidInput, path + ": " + what);
}

std::span<const std::byte> bytes_of_positions(const Mesh& mesh) {
  return std::visit([](auto positions) { return std::as_bytes(positions); }, mesh.positions);
}

bool has_doubles(const Mesh& mesh) {
  return std::holds_alternative<std::span<const double>>(mesh.positions);
}

size_t bytes_per_position(const Mesh& mesh) { return 3 * (has_doubles(mesh) ? sizeof(double) : 4); }

bool has_texture(const Mesh& mesh) {
  return !mesh.texture.empty() && !mesh.texture_coordinates.empty();
}

constexpr size_t kColorBytes = 4, kTextureBytes = 2 * sizeof(float);  // per vertex

std::string ply_header(const Mesh& mesh, uint64_t vertices, uint64_t triangles) {
  const std::string number = has_doubles(mesh) ? "double" : "float";
  std::string text = "ply\nformat binary_";
  text += std::endian::native == std::endian::little ? "little" : "big";
  text += "_endian 1.0\n";
  if (has_texture(mesh)) text += "comment TextureFile " + mesh.texture_name + '\n';
  text += "element vertex " + std::to_string(vertices) + '\n';
  for (const char* const axis : {"x", "y", "z"}) text += "property " + number + ' ' + axis + '\n';
  if (!mesh.colors.empty())
    for (const char* const channel : {"red", "green", "blue", "alpha"})
      text += std::string("property uchar ") + channel + '\n';
  if (has_texture(mesh)) text += "property float s\nproperty float t\n";
  return text + "element face " + std::to_string(triangles) +
         "\nproperty list uchar uint vertex_indices\nend_header\n";
}

// Size of a face in the PLY file: one byte for the number of corners, and three vertex indices.
constexpr size_t kFaceBytes = 1 + 3 * sizeof(uint32_t);

// A file whose bytes come from several contiguous arrays.
class MemoryFile : public ReadableFile {
 public:
  MemoryFile(std::string path, uint64_t size) : path_(std::move(path)), size_(size) {}
  const std::string& path() const override { return path_; }
  uint64_t size() const override { return size_; }
  void read_at(uint64_t offset, std::span<std::byte> out) const override {
    if (offset > size_ || out.size() > size_ - offset)
      throw Error(ErrorCode::kCorrupt, path_ + " has " + std::to_string(size_) +
                                           " bytes: expected " + std::to_string(out.size()) +
                                           " bytes at offset " + std::to_string(offset));
    while (!out.empty()) {
      const size_t done = read_some(offset, out);
      offset += done;
      out = out.subspan(done);
    }
  }

 protected:
  static size_t copy(std::span<const std::byte> from, uint64_t offset, std::span<std::byte> out) {
    const size_t bytes = std::min<size_t>(from.size() - offset, out.size());
    std::memcpy(out.data(), from.data() + offset, bytes);
    return bytes;
  }

 private:
  // Reads at least one byte, and at most all bytes from `offset` to the end of the contiguous array
  // that contains it. Returns the number of bytes.
  virtual size_t read_some(uint64_t offset, std::span<std::byte> out) const = 0;

  const std::string path_;
  const uint64_t size_;
};

class BytesFile : public MemoryFile {
 public:
  BytesFile(const std::string& path, std::span<const std::byte> bytes)
      : MemoryFile(path, bytes.size()), bytes_(bytes) {}

 private:
  size_t read_some(uint64_t offset, std::span<std::byte> out) const override {
    return copy(bytes_, offset, out);
  }

  const std::span<const std::byte> bytes_;
};

// The lengths of the parts of a mesh's PLY file.
struct PlyParts {
  explicit PlyParts(const Mesh& mesh)
      : position_bytes(bytes_per_position(mesh)),
        color_bytes(mesh.colors.empty() ? 0 : kColorBytes),
        vertex_bytes(position_bytes + color_bytes + (has_texture(mesh) ? kTextureBytes : 0)),
        vertices(bytes_of_positions(mesh).size() / position_bytes),
        header(ply_header(mesh, vertices, mesh.indices.size() / 3)),
        faces_begin(header.size() + vertices * vertex_bytes),
        size(faces_begin + mesh.indices.size() / 3 * kFaceBytes) {}

  const size_t position_bytes, color_bytes, vertex_bytes;  // per vertex
  const uint64_t vertices;
  const std::string header;
  const uint64_t faces_begin, size;
};

class MeshFile : public MemoryFile {
 public:
  MeshFile(const std::string& path, const Mesh& mesh)
      : MemoryFile(path, PlyParts(mesh).size),
        mesh_(mesh),
        positions_(bytes_of_positions(mesh)),
        parts_(mesh) {}

 private:
  size_t read_some(uint64_t offset, std::span<std::byte> out) const override {
    const size_t header_bytes = parts_.header.size();
    if (offset < header_bytes) return copy(std::as_bytes(std::span(parts_.header)), offset, out);
    if (offset < parts_.faces_begin) return read_vertices(offset - header_bytes, out);
    const uint64_t face = (offset - parts_.faces_begin) / kFaceBytes;
    std::array<std::byte, kFaceBytes> row{std::byte{3}};
    std::memcpy(&row[1], &mesh_.indices[3 * face], 3 * sizeof(uint32_t));
    return copy(row, (offset - parts_.faces_begin) % kFaceBytes, out);
  }
  size_t read_vertices(uint64_t offset, std::span<std::byte> out) const {
    const size_t colors_begin = parts_.position_bytes;
    const size_t texture_begin = colors_begin + parts_.color_bytes;
    if (parts_.vertex_bytes == colors_begin) return copy(positions_, offset, out);
    const uint64_t vertex = offset / parts_.vertex_bytes, within = offset % parts_.vertex_bytes;
    if (within < colors_begin)
      return copy(positions_.subspan(vertex * colors_begin, colors_begin), within, out);
    if (within < texture_begin)
      return copy(std::as_bytes(mesh_.colors.subspan(kColorBytes * vertex, kColorBytes)),
                  within - colors_begin, out);
    return copy(std::as_bytes(mesh_.texture_coordinates.subspan(2 * vertex, 2)),
                within - texture_begin, out);
  }

  const Mesh mesh_;
  const std::span<const std::byte> positions_;
  const PlyParts parts_;
};

// Throws Error{kInvalidInput} unless the lengths of the mesh's arrays fit each other.
void check_lengths(const std::string& path, const Mesh& mesh) {
  const size_t numbers =
      std::visit([](auto positions) { return positions.size(); }, mesh.positions);
  const std::string vertices = std::to_string(numbers / 3) + " vertices";
  if (numbers % 3 != 0)
    refuse_mesh(path, std::to_string(numbers) + " coordinates: expected three for each vertex");
  if (mesh.indices.size() % 3 != 0)
    refuse_mesh(path, std::to_string(mesh.indices.size()) +
                          " vertex numbers: expected three for each triangle");
  if (!mesh.colors.empty() && mesh.colors.size() != 4 * (numbers / 3))
    refuse_mesh(path, std::to_string(mesh.colors.size()) +
                          " color channels: expected four for each of " + vertices);
  if (!mesh.texture_coordinates.empty() && mesh.texture_coordinates.size() != 2 * (numbers / 3))
    refuse_mesh(path, std::to_string(mesh.texture_coordinates.size()) +
                          " texture coordinates: expected two for each of " + vertices);
}

// Returns the path at which the PLY reader looks for the texture `name` of the mesh at `mesh_path`.
// `mesh_path` has no folder. Throws if `name` cannot be the name of a file.
std::string texture_path(const std::string& mesh_path, const std::string& name) {
  if (name.empty() || name.find_first_of("/\\:\"\n\r") != name.npos)
    refuse_mesh(mesh_path, "the texture's name \"" + name +
                               "\": expected a name without slashes, colons, quotes and line ends");
  return parent_directory(mesh_path) + "/" + name;
}

}  // namespace

void MeshFiles::add(const std::string& path, const Mesh& mesh) {
  check_lengths(path, mesh);
  if (has_texture(mesh)) bytes_[texture_path(path, mesh.texture_name)] = mesh.texture;
  meshes_.insert_or_assign(path, mesh);
}

void MeshFiles::add_file(const std::string& path, std::span<const std::byte> bytes) {
  bytes_[path] = bytes;
}

std::unique_ptr<ReadableFile> MeshFiles::open_read(const std::string& path) {
  if (const auto mesh = meshes_.find(path); mesh != meshes_.end())
    return std::make_unique<MeshFile>(path, mesh->second);
  if (const auto file = bytes_.find(path); file != bytes_.end())
    return std::make_unique<BytesFile>(path, file->second);
  return ForwardingFiles::open_read(path);
}

bool MeshFiles::exists(const std::string& path) {
  return meshes_.contains(path) || bytes_.contains(path) || ForwardingFiles::exists(path);
}

}  // namespace voxdag
