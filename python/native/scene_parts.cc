#include "python/native/scene_parts.h"

#include <cstddef>
#include <span>

namespace voxdag::python {
namespace {

template <class Number>
std::span<const Number> numbers_of(const auto& rows) {
  return {static_cast<const Number*>(rows.data()), rows.size()};
}

std::span<const std::byte> bytes_of(const nb::bytes& bytes) {
  return {static_cast<const std::byte*>(bytes.data()), bytes.size()};
}

Mesh mesh_of(const MeshArrays& arrays) {
  const auto& [path, vertices, triangles, colors, name, texture, coordinates] = arrays;
  Mesh mesh;
  if (vertices.dtype() == nb::dtype<float>())
    mesh.positions = numbers_of<float>(vertices);
  else if (vertices.dtype() == nb::dtype<double>())
    mesh.positions = numbers_of<double>(vertices);
  else
    throw nb::type_error("vertices: expected float32 or float64");
  mesh.indices = numbers_of<uint32_t>(triangles);
  if (colors) mesh.colors = numbers_of<uint8_t>(*colors);
  if (!coordinates) return mesh;
  mesh.texture_name = name;
  mesh.texture = bytes_of(texture);
  mesh.texture_coordinates = numbers_of<float>(*coordinates);
  return mesh;
}

}  // namespace

void add_parts(const SceneParts& parts, MeshFiles& files, std::vector<std::string>& scenes) {
  for (const PathText& file : parts.files) scenes.push_back(file.bytes);
  for (const auto& [path, bytes] : parts.bytes) {
    scenes.push_back(path);
    files.add_file(path, bytes_of(bytes));
  }
  for (const MeshArrays& mesh : parts.meshes) {
    scenes.push_back(std::get<0>(mesh));
    files.add(scenes.back(), mesh_of(mesh));
  }
}

}  // namespace voxdag::python
