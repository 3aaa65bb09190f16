// glTF files with compressed meshes, if the libraries that write them exist.
#include "tests/cli/inputs/input.h"
#include "tests/unit/scene/compressed/draco_scenes.h"
#include "tests/unit/scene/compressed/meshopt_scenes.h"
#include "tests/unit/scene/compressed/vertex_stream_writer.h"

namespace input_files {
namespace {

#ifdef VOXDAG_HAS_MESHOPT

std::vector<uint32_t> corners() {
  std::vector<uint32_t> all;
  for (const auto& triangle : band().triangles())
    all.insert(all.end(), triangle.begin(), triangle.end());
  return all;
}

// 16-bit positions as gltfpack writes them: four integers for each vertex.
std::vector<uint16_t> integers() {
  std::vector<uint16_t> all;
  for (const auto& vertex : band().vertices) {
    for (const float c : vertex) all.push_back(static_cast<uint16_t>(c));
    all.push_back(0);
  }
  return all;
}

SceneBuilder meshopt_scene(const std::vector<unsigned char>& positions, int type, size_t stride) {
  using namespace voxdag::test;
  const size_t vertices = band().vertices.size();
  const std::vector<uint32_t> all = corners();
  std::vector<unsigned char> indices(meshopt_encodeIndexBufferBound(all.size(), vertices));
  indices.resize(meshopt_encodeIndexBuffer(indices.data(), indices.size(), all.data(), all.size()));
  SceneBuilder scene;
  const int p = add_compressed(scene, positions, vertices, stride, "ATTRIBUTES");
  const int t = add_compressed(scene, indices, all.size(), 2, "TRIANGLES");
  draw(scene, add_accessor_of(scene, p, type, vertices, "VEC3"),
       add_accessor_of(scene, t, kU16, all.size(), "SCALAR"));
  if (type == kU16) scene.root["extensionsUsed"] = {"KHR_mesh_quantization"};
  return scene;
}

std::vector<Input> meshopt_inputs() {
  using namespace voxdag::test;
  const std::vector<uint16_t> positions = integers();
  const std::string bytes(reinterpret_cast<const char*>(positions.data()), 2 * positions.size());
  return {
      {"KHR_meshopt_compression",
       khr_meshopt_glb(meshopt_scene(encode_vertices(positions, 8), kU16, 8)),
       {}},
      {"KHR_meshopt_compression, streams of version 1",
       khr_meshopt_glb(meshopt_scene(write_vertex_stream_1(bytes, 8, {1, 1}, 1), kU16, 8)),
       {}},
      {"KHR_meshopt_compression of float",
       khr_meshopt_glb(meshopt_scene(encode_vertices(band().coordinates(), 12), kF32, 12)),
       {}},
  };
}

#else
std::vector<Input> meshopt_inputs() { return {}; }
#endif

#ifdef VOXDAG_HAS_DRACO

// Encodes the mesh with Draco sequentially and without quantization, so that the coordinates are
// exact.
std::vector<char> draco_data() {
  draco::Mesh mesh;
  const auto points = static_cast<uint32_t>(band().vertices.size());
  mesh.set_num_points(points);
  draco::GeometryAttribute position;
  position.Init(draco::GeometryAttribute::POSITION, nullptr, 3, draco::DT_FLOAT32, false, 12, 0);
  const int positions = mesh.AddAttribute(position, true, points);
  for (uint32_t i = 0; i < points; ++i)
    mesh.attribute(positions)->SetAttributeValue(draco::AttributeValueIndex(i),
                                                 band().vertices[i].data());
  for (const auto& triangle : band().triangles())
    mesh.AddFace({draco::PointIndex(triangle[0]), draco::PointIndex(triangle[1]),
                  draco::PointIndex(triangle[2])});
  return voxdag::test::encode_draco(mesh, draco::MESH_SEQUENTIAL_ENCODING, 0);
}

std::vector<Input> draco_inputs() {
  const std::vector<char> data = draco_data();
  std::vector<Input> all = {
      {"Draco, too many vertices", voxdag::test::compressed_scene(data, 17, 24).glb(), {}},
      {"Draco, too many indices", voxdag::test::compressed_scene(data, 12, 27).glb(), {}},
  };
  for (Input& input : all) input.warning = "draco-counts";
  return all;
}

#else
std::vector<Input> draco_inputs() { return {}; }
#endif

}  // namespace

std::vector<Input> compressed_inputs() {
  std::vector<Input> all = meshopt_inputs();
  const std::vector<Input> more = draco_inputs();
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

}  // namespace input_files
