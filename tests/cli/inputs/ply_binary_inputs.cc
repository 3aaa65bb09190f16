// Binary PLY files, and PLY files with concave polygons.
#include "tests/cli/inputs/input.h"
#include "tests/unit/scene/ply_writer.h"

namespace input_files {
namespace {

using voxdag::test::PlyFormat;
using voxdag::test::PlyWriter;

// Returns the mesh as a little-endian PLY file. With `with_lists`, each vertex also has a list of 0
// to 3 numbers between its coordinates x and y.
std::string binary(const std::string& line_end, bool with_lists) {
  PlyWriter ply(PlyFormat::kLittle, line_end);
  ply.header("element vertex 12").header("property float x");
  if (with_lists) ply.header("property list uchar ushort views");
  ply.header("property float y").header("property float z").header("element face 8");
  ply.header("property list uchar int vertex_indices").header("end_header");
  uint8_t views = 0;
  for (const auto& vertex : band().vertices) {
    ply.put(vertex[0]);
    if (with_lists) {
      ply.put(views);
      for (uint16_t i = 0; i < views; ++i) ply.put(i);
      views = static_cast<uint8_t>((views + 1) % 4);
    }
    ply.put(vertex[1]).put(vertex[2]);
  }
  for (const auto& triangle : band().triangles()) {
    ply.put<uint8_t>(3);
    for (const uint32_t index : triangle) ply.put(static_cast<int32_t>(index));
  }
  return ply.text();
}

using Points = std::vector<std::array<double, 2>>;

// Returns a file with a polygon in the plane z = 0, and with a degenerate triangle above it.
// `triangles` are the triangles into which the polygon must be divided, as indices of `corners`.
Input polygon(const std::string& name, const Points& corners,
              const std::vector<std::array<size_t, 3>>& triangles) {
  Input input{name, "", {}, {}};
  std::string rows, indices = std::to_string(corners.size());
  for (size_t i = 0; i < corners.size(); ++i) {
    rows += std::to_string(corners[i][0]) + ' ' + std::to_string(corners[i][1]) + " 0\n";
    indices += ' ' + std::to_string(i);
  }
  const size_t count = corners.size() + 3;
  for (size_t i = corners.size(); i < count; ++i) rows += "0 0 " + std::to_string(i) + "\n";
  input.file = "ply\nformat ascii 1.0\nelement vertex " + std::to_string(count) +
               "\nproperty float x\nproperty float y\nproperty float z\nelement face 2\n"
               "property list uchar int vertex_indices\nend_header\n" +
               rows + indices + "\n3 " + std::to_string(count - 3) + ' ' +
               std::to_string(count - 2) + ' ' + std::to_string(count - 1) + '\n';
  for (const auto& triangle : triangles) {
    oracle::WorldTriangle world;
    for (size_t k = 0; k < 3; ++k) world[k] = {corners[triangle[k]][0], corners[triangle[k]][1], 0};
    input.triangles.push_back(world);
  }
  const double z = static_cast<double>(corners.size());
  input.triangles.push_back({{{0, 0, z}, {0, 0, z + 1}, {0, 0, z + 2}}});
  return input;
}

}  // namespace

std::vector<Input> ply_binary_inputs() {
  return {{"lists of vertices", binary("\n", true), {}},
          {"binary with line ends CR LF", binary("\r\n", false), {}}};
}

std::vector<Input> polygon_inputs() {
  return {
      polygon("concave L", {{6, 3}, {3, 3}, {3, 9}, {0, 9}, {0, 0}, {6, 0}},
              {{0, 1, 4}, {0, 4, 5}, {1, 2, 4}, {2, 3, 4}}),
      polygon("concave U", {{7, 2}, {3, 2}, {3, 7}, {7, 7}, {7, 10}, {0, 10}, {0, 0}, {7, 0}},
              {{0, 1, 6}, {0, 6, 7}, {1, 2, 6}, {2, 5, 6}, {2, 3, 5}, {3, 4, 5}}),
      polygon("concave quad", {{0, 0}, {6, 1}, {8, 9}, {5, 3}}, {{0, 1, 3}, {1, 2, 3}}),
  };
}

}  // namespace input_files
