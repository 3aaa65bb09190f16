// Decodes glTF files, which store rectangles as two triangles each. Adds the faces of unit cells
// that each rectangle covers.
#include <nlohmann/json.hpp>

#include "tests/export/whole/formats.h"

namespace voxdag::test {

void digest_glb(const std::string& path, const Grid& grid, Digest& digest) {
  const MappedFile file(path);
  expect(file.text(0, 4) == "glTF" && file.get<uint32_t>(8) == file.size(), "a binary glTF");
  const auto json_bytes = file.get<uint32_t>(12);
  const nlohmann::json scene = nlohmann::json::parse(file.text(20, json_bytes));
  const uint64_t binary = 28 + uint64_t{json_bytes};
  const nlohmann::json &views = scene["bufferViews"], &node = scene["nodes"][0];
  const uint64_t positions = binary + views[0].value("byteOffset", uint64_t{0});
  const uint64_t indices = binary + views[1].value("byteOffset", uint64_t{0});
  const uint64_t count = scene["accessors"][1]["count"];
  const bool short_positions = scene["accessors"][0]["componentType"] == 5123;
  const bool short_indices = scene["accessors"][1]["componentType"] == 5123;
  std::array<double, 3> scale, translation;
  for (size_t axis = 0; axis < 3; ++axis) {
    scale[axis] = node["scale"][axis];
    translation[axis] = node["translation"][axis];
  }
  using Corner = std::array<int64_t, 3>;
  const auto corner = [&](uint64_t index) {
    Corner at;
    const uint64_t vertex = short_indices ? file.get<uint16_t>(indices + 2 * index)
                                          : file.get<uint32_t>(indices + 4 * index);
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<size_t>(axis);
      const double position =
          short_positions ? static_cast<double>(file.get<uint16_t>(positions + 8 * vertex + 2 * a))
                          : static_cast<double>(file.get<float>(positions + 12 * vertex + 4 * a));
      at[a] = grid.cell(axis, position * scale[a] + translation[a], 0);
    }
    return at;
  };
  for (uint64_t i = 0; i < count; i += 6) {
    const std::array<Corner, 6> c = {corner(i),     corner(i + 1), corner(i + 2),
                                     corner(i + 3), corner(i + 4), corner(i + 5)};
    expect(c[0] == c[3] && c[2] == c[4], "two triangles of a rectangle");
    Corner low = c[0], high = c[0];
    for (const Corner& other : {c[1], c[2], c[5]})
      for (size_t axis = 0; axis < 3; ++axis) {
        low[axis] = std::min(low[axis], other[axis]);
        high[axis] = std::max(high[axis], other[axis]);
      }
    const size_t axis = low[0] == high[0] ? 0 : low[1] == high[1] ? 1 : 2;
    const size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
    expect(low[axis] == high[axis] && low[u] < high[u] && low[v] < high[v], "a rectangle");
    const bool is_first = c[1][u] == c[0][u] && c[1][v] == c[2][v];
    expect(c[0][u] != c[2][u] && c[0][v] != c[2][v] &&
               (is_first || (c[1][u] == c[2][u] && c[1][v] == c[0][v])) &&
               c[5][u] == c[0][u] + c[2][u] - c[1][u] && c[5][v] == c[0][v] + c[2][v] - c[1][v],
           "the two halves of a rectangle, turned alike");
    const int64_t normal =
        (c[1][u] - c[0][u]) * (c[2][v] - c[0][v]) - (c[1][v] - c[0][v]) * (c[2][u] - c[0][u]);
    const bool upward = normal > 0;
    Corner cell = low;
    if (upward) --cell[axis];
    for (cell[u] = low[u]; cell[u] < high[u]; ++cell[u])
      for (cell[v] = low[v]; cell[v] < high[v]; ++cell[v])
        digest.add(cell[0], cell[1], cell[2], 1 + 2 * axis + upward);
  }
}

}  // namespace voxdag::test
