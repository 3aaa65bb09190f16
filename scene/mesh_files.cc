#include "scene/mesh_files.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <span>

#include "core/base/error.h"

namespace voxdag {
namespace {

[[noreturn]] void refuse_mesh(const std::string& what) {
  throw Error(ErrorCode::kInvalidInput, std::string(MeshFiles::kPath) + ": " + what);
}

std::span<const std::byte> bytes_of_positions(const Mesh& mesh) {
  return std::visit([](auto positions) { return std::as_bytes(positions); }, mesh.positions);
}

bool has_doubles(const Mesh& mesh) {
  return std::holds_alternative<std::span<const double>>(mesh.positions);
}

size_t position_bytes(const Mesh& mesh) { return 3 * (has_doubles(mesh) ? sizeof(double) : 4); }

std::string ply_header(const Mesh& mesh, uint64_t vertices, uint64_t triangles) {
  const std::string number = has_doubles(mesh) ? "double" : "float";
  std::string text = "ply\nformat binary_";
  text += std::endian::native == std::endian::little ? "little" : "big";
  text += "_endian 1.0\nelement vertex " + std::to_string(vertices) + '\n';
  for (const char* const axis : {"x", "y", "z"}) text += "property " + number + ' ' + axis + '\n';
  if (!mesh.colors.empty())
    for (const char* const channel : {"red", "green", "blue", "alpha"})
      text += std::string("property uchar ") + channel + '\n';
  return text + "element face " + std::to_string(triangles) +
         "\nproperty list uchar uint vertex_indices\nend_header\n";
}

// A face: the number of corners, and their vertex indices.
constexpr size_t kFaceBytes = 1 + 3 * sizeof(uint32_t);

class MeshFile : public ReadableFile {
 public:
  explicit MeshFile(const Mesh& mesh)
      : mesh_(mesh),
        positions_(bytes_of_positions(mesh)),
        position_bytes_(position_bytes(mesh)),
        vertex_bytes_(position_bytes_ + (mesh.colors.empty() ? 0 : 4)),
        vertices_(positions_.size() / position_bytes_),
        header_(ply_header(mesh, vertices_, mesh.indices.size() / 3)),
        faces_begin_(header_.size() + vertices_ * vertex_bytes_),
        size_(faces_begin_ + mesh.indices.size() / 3 * kFaceBytes) {}

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

 private:
  // Reads at least one byte, at most to the end of the contiguous array at `offset`.
  size_t read_some(uint64_t offset, std::span<std::byte> out) const {
    if (offset < header_.size()) return copy(std::as_bytes(std::span(header_)), offset, out);
    if (offset < faces_begin_) return read_vertices(offset - header_.size(), out);
    const uint64_t face = (offset - faces_begin_) / kFaceBytes;
    std::array<std::byte, kFaceBytes> row{std::byte{3}};
    std::memcpy(&row[1], &mesh_.indices[3 * face], 3 * sizeof(uint32_t));
    return copy(row, (offset - faces_begin_) % kFaceBytes, out);
  }
  size_t read_vertices(uint64_t offset, std::span<std::byte> out) const {
    if (mesh_.colors.empty()) return copy(positions_, offset, out);
    const uint64_t vertex = offset / vertex_bytes_, within = offset % vertex_bytes_;
    if (within < position_bytes_)
      return copy(positions_.subspan(vertex * position_bytes_, position_bytes_), within, out);
    return copy(std::as_bytes(mesh_.colors.subspan(4 * vertex, 4)), within - position_bytes_, out);
  }
  static size_t copy(std::span<const std::byte> from, uint64_t offset, std::span<std::byte> out) {
    const size_t bytes = std::min<size_t>(from.size() - offset, out.size());
    std::memcpy(out.data(), from.data() + offset, bytes);
    return bytes;
  }

  const std::string path_ = MeshFiles::kPath;
  const Mesh mesh_;
  const std::span<const std::byte> positions_;
  const size_t position_bytes_, vertex_bytes_;  // bytes per vertex
  const uint64_t vertices_;
  const std::string header_;
  const uint64_t faces_begin_, size_;
};

}  // namespace

MeshFiles::MeshFiles(FileSystem& files, const Mesh& mesh) : ForwardingFiles(files), mesh_(mesh) {
  const size_t numbers =
      std::visit([](auto positions) { return positions.size(); }, mesh.positions);
  if (numbers % 3 != 0)
    refuse_mesh(std::to_string(numbers) + " coordinates: expected three for each vertex");
  if (mesh.indices.size() % 3 != 0)
    refuse_mesh(std::to_string(mesh.indices.size()) +
                " vertex numbers: expected three for each triangle");
  if (!mesh.colors.empty() &&
      (mesh.colors.size() % 4 != 0 || mesh.colors.size() / 4 != numbers / 3))
    refuse_mesh(std::to_string(mesh.colors.size()) + " color channels: expected four for each of " +
                std::to_string(numbers / 3) + " vertices");
}

std::unique_ptr<ReadableFile> MeshFiles::open_read(const std::string& path) {
  if (path == kPath) return std::make_unique<MeshFile>(mesh_);
  return ForwardingFiles::open_read(path);
}

bool MeshFiles::exists(const std::string& path) {
  return path == kPath || ForwardingFiles::exists(path);
}

}  // namespace voxdag
