#include "scene/import/mesh_export.h"

#include <algorithm>
#include <array>
#include <span>

#include "core/base/error.h"
#include "scene/surface_numbers.h"
#include "scene/textures/linear_light.h"

namespace voxdag {
namespace {

using nlohmann::json;

std::span<const aiFace> faces_of(const aiMesh& mesh) { return {mesh.mFaces, mesh.mNumFaces}; }

// Returns the minimum and the maximum of each coordinate, over all finite values.
std::array<std::array<float, 3>, 2> limits_of(const aiMesh& mesh) {
  std::array<std::array<float, 3>, 2> limits{};
  for (unsigned axis = 0; axis < 3; ++axis) {
    bool is_first = true;
    for (const aiVector3D& p : std::span(mesh.mVertices, mesh.mNumVertices)) {
      if (!(p[axis] - p[axis] == 0)) continue;
      limits[0][axis] = is_first ? p[axis] : std::min(limits[0][axis], p[axis]);
      limits[1][axis] = is_first ? p[axis] : std::max(limits[1][axis], p[axis]);
      is_first = false;
    }
  }
  return limits;
}

// Returns the linear light of an sRGB color, as normalized integers.
std::array<uint16_t, 4> light_of(const aiColor4D& color) {
  const auto light = [](float channel) {
    return channel > 0 ? linear_light(std::min(channel, 1.0f)) : uint16_t{0};
  };
  return {light(color.r), light(color.g), light(color.b), intensity_of(color.a)};
}

}  // namespace

MeshExport::MeshExport(const aiMesh& mesh, std::string where, unsigned uv_channel,
                       WarningList& warnings)
    : mesh_(mesh),
      where_(std::move(where)),
      texcoords_(mesh.HasTextureCoords(uv_channel) ? mesh.mTextureCoords[uv_channel] : nullptr),
      colors_(mesh.HasVertexColors(0) ? mesh.mColors[0] : nullptr) {
  uint64_t points_or_lines = 0;
  for (const aiFace& face : faces_of(mesh)) {
    for (const unsigned index : std::span(face.mIndices, face.mNumIndices))
      if (index >= mesh.mNumVertices)
        throw Error(ErrorCode::kInvalidInput,
                    where_ + ": index " + std::to_string(index) + ", expected less than " +
                        std::to_string(mesh.mNumVertices) + ", the number of vertices");
    if (face.mNumIndices < 3)
      ++points_or_lines;
    else
      triangles_ += face.mNumIndices - 2;
  }
  if (points_or_lines > 0)
    warnings.add({"points-or-lines", where_, "points and lines make no voxels", points_or_lines});
}

json MeshExport::add_to(GlbArrays& arrays) const {
  const uint64_t vertices = mesh_.mNumVertices, indices = 3 * triangles_;
  json attributes;
  const auto add = [&](const char* name, uint64_t bytes_of_vertex, json accessor) {
    accessor["count"] = vertices;
    attributes[name] = arrays.accessors.size();
    arrays.add(bytes_of_vertex * vertices, bytes_of_vertex * vertices, kGlbVertices,
               std::move(accessor));
  };
  const auto [low, high] = limits_of(mesh_);
  add("POSITION", 12,
      {{"componentType", kGlbFloat}, {"type", "VEC3"}, {"min", low}, {"max", high}});
  if (texcoords_) add("TEXCOORD_0", 8, {{"componentType", kGlbFloat}, {"type", "VEC2"}});
  if (colors_)
    add("COLOR_0", 8, {{"componentType", kGlbUint16}, {"type", "VEC4"}, {"normalized", true}});
  json primitive = {{"attributes", std::move(attributes)}, {"indices", arrays.accessors.size()}};
  arrays.add(4 * indices, 4 * indices, kGlbIndices,
             {{"componentType", kGlbUint32}, {"type", "SCALAR"}, {"count", indices}});
  return primitive;
}

void MeshExport::write(GlbFile& file, MemoryBudget& budget, WarningList& warnings) const {
  for (const aiVector3D& p : std::span(mesh_.mVertices, mesh_.mNumVertices)) {
    const float xyz[] = {p.x, p.y, p.z};
    file.put(xyz, sizeof xyz);
  }
  // In assimp, the texture coordinate v runs upward; in glTF, downward.
  if (texcoords_)
    for (const aiVector3D& p : std::span(texcoords_, mesh_.mNumVertices)) {
      const float uv[] = {p.x, 1 - p.y};
      file.put(uv, sizeof uv);
    }
  if (colors_)
    for (const aiColor4D& color : std::span(colors_, mesh_.mNumVertices)) {
      const auto light = light_of(color);
      file.put(light.data(), sizeof light);
    }
  write_indices(file, budget, warnings);
}

void MeshExport::write_indices(GlbFile& file, MemoryBudget& budget, WarningList& warnings) const {
  polygon::Triangulator triangulator(budget, "a polygon of " + where_);
  std::vector<double> xyz;
  uint64_t doubtful = 0;
  for (const aiFace& face : faces_of(mesh_)) {
    std::span<const uint32_t> split;
    if (face.mNumIndices > 3) {
      xyz.clear();
      for (const unsigned index : std::span(face.mIndices, face.mNumIndices))
        for (unsigned axis = 0; axis < 3; ++axis) xyz.push_back(mesh_.mVertices[index][axis]);
      if (triangulator.triangulate(xyz)) split = triangulator.triangles();
      doubtful += triangulator.is_doubtful();
    }
    for (size_t t = 0; t + 2 < face.mNumIndices; ++t) {
      uint32_t triangle[3];
      for (size_t k = 0; k < 3; ++k)
        triangle[k] = face.mIndices[polygon::position_of_corner(split, t, k)];
      file.put(triangle, sizeof triangle);
    }
  }
  if (doubtful > 0) warnings.add(polygon::crossing_edges(where_, "the edges of a face", doubtful));
}

}  // namespace voxdag
