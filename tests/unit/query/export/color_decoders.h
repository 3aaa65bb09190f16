// Decoders that return the voxels and colors of exported files. They were written from descriptions
// of the formats, without the code of the exports.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace voxdag::query {

using Cell3 = std::array<int64_t, 3>;
using Color3 = std::array<int, 3>;

// Reads numbers and texts from the bytes of a file, one after the other.
class FileNumbers {
 public:
  explicit FileNumbers(const std::string& bytes, size_t at = 0) : bytes_(bytes), at_(at) {}
  void seek(size_t at) { at_ = at; }
  template <class T>
  T next() {
    T value{};
    if (at_ + sizeof(T) > bytes_.size()) {
      ADD_FAILURE() << "the file ends early, at byte " << at_;
      at_ = bytes_.size();
      return value;
    }
    std::memcpy(&value, bytes_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }
  std::string text(size_t size) {
    const std::string text = bytes_.substr(std::min(at_, bytes_.size()), size);
    at_ += size;
    return text;
  }
  std::string text() { return text(next<uint32_t>()); }
  size_t at() const { return at_; }
  bool at_end() const { return at_ >= bytes_.size(); }

 private:
  const std::string& bytes_;
  size_t at_;
};

// Returns the color of each voxel in a .vox file. Position (x, y, z) in the file is (x, z, -y) in
// voxdag, relative to the middle of the floor.
inline std::map<Cell3, Color3> decode_vox(const std::string& bytes, int64_t resolution) {
  struct Model {
    int64_t edge = 0;
    std::vector<std::array<uint8_t, 4>> voxels;
  };
  std::vector<Model> models;
  std::vector<std::array<int64_t, 3>> places;
  std::vector<int32_t> shapes;
  std::vector<Color3> palette;
  FileNumbers file(bytes);
  EXPECT_EQ(file.text(4), "VOX ");
  EXPECT_EQ(file.next<uint32_t>(), 150u);
  EXPECT_EQ(file.text(4), "MAIN");
  EXPECT_EQ(file.next<uint32_t>(), 0u);
  EXPECT_EQ(file.next<uint32_t>(), bytes.size() - 20);
  while (!file.at_end()) {
    const std::string id = file.text(4);
    const uint32_t size = file.next<uint32_t>();
    EXPECT_EQ(file.next<uint32_t>(), 0u);
    const size_t end = file.at() + size;
    if (id == "SIZE") {
      models.push_back({file.next<int32_t>(), {}});
    } else if (id == "XYZI") {
      for (uint32_t count = file.next<uint32_t>(); count > 0 && !file.at_end(); --count)
        models.back().voxels.push_back(file.next<std::array<uint8_t, 4>>());
    } else if (id == "nTRN") {
      file.text(24);  // id, no attributes, child, reserved, layer, one frame
      if (file.next<int32_t>() == 1) {
        EXPECT_EQ(file.text(), "_t");
        std::array<int64_t, 3> place{};
        std::istringstream(file.text()) >> place[0] >> place[1] >> place[2];
        places.push_back(place);
      }
    } else if (id == "nSHP") {
      file.text(12);  // id, no attributes, one model
      shapes.push_back(file.next<int32_t>());
    } else if (id == "RGBA") {
      for (int i = 0; i < 256; ++i) {
        const auto color = file.next<std::array<uint8_t, 4>>();
        palette.push_back({color[0], color[1], color[2]});
      }
    }
    file.seek(end);
  }
  EXPECT_EQ(places.size(), shapes.size());
  EXPECT_EQ(palette.size(), 256u);
  std::map<Cell3, Color3> cells;
  for (size_t i = 0; i < places.size(); ++i) {
    const Model& model = models.at(static_cast<size_t>(shapes[i]));
    for (const auto& voxel : model.voxels) {
      const int64_t half = model.edge / 2, middle = resolution / 2;
      const int64_t x = places[i][0] - half + voxel[0], y = places[i][1] - half + voxel[1],
                    z = places[i][2] - half + voxel[2];
      EXPECT_NE(voxel[3], 0);
      const bool is_new =
          cells.emplace(Cell3{x + middle, z, middle - 1 - y}, palette.at(voxel[3] - 1u)).second;
      EXPECT_TRUE(is_new) << "a voxel comes twice";
    }
  }
  return cells;
}

// Returns the color of each face in a .glb file of one mesh, by the cell and the direction of the
// face (x: 0, -x: 1, y: 2, ...). Colors are the stored 16-bit values. Sets `rectangles` to the
// number of rectangles.
inline std::map<std::pair<Cell3, int>, Color3> decode_glb(const std::string& bytes,
                                                          const Cell3& region_low,
                                                          size_t& rectangles) {
  FileNumbers file(bytes);
  EXPECT_EQ(file.text(4), "glTF");
  EXPECT_EQ(file.next<uint32_t>(), 2u);
  EXPECT_EQ(file.next<uint32_t>(), bytes.size());
  const uint32_t json_size = file.next<uint32_t>();
  EXPECT_EQ(file.text(4), "JSON");
  const auto document = nlohmann::json::parse(file.text(json_size));
  const uint32_t binary_size = file.next<uint32_t>();
  EXPECT_EQ(file.text(4), (std::string{"BIN\0", 4}));
  EXPECT_EQ(binary_size, bytes.size() - file.at());
  const size_t binary = file.at();
  const auto& primitive = document["meshes"][0]["primitives"][0];
  const auto values_of = [&](const nlohmann::json& accessor_index, int type, const char* shape) {
    const auto& accessor = document["accessors"][accessor_index.get<size_t>()];
    EXPECT_EQ(accessor["componentType"], type);
    EXPECT_EQ(accessor["type"], shape);
    const auto& view = document["bufferViews"][accessor["bufferView"].get<size_t>()];
    EXPECT_EQ(view.value("byteOffset", 0) % 4, 0);
    return FileNumbers(bytes, binary + view.value("byteOffset", size_t{0}));
  };
  const auto& color_accessor =
      document["accessors"][primitive["attributes"]["COLOR_0"].get<size_t>()];
  const auto& index_accessor = document["accessors"][primitive["indices"].get<size_t>()];
  EXPECT_EQ(color_accessor["normalized"], true);
  EXPECT_FALSE(document["materials"][0]["pbrMetallicRoughness"].contains("baseColorFactor"));
  using Vertex = std::array<uint16_t, 4>;
  std::vector<Vertex> positions(color_accessor["count"].get<size_t>()), colors(positions.size());
  FileNumbers position = values_of(primitive["attributes"]["POSITION"], 5123, "VEC3");
  for (Vertex& at : positions) at = position.next<Vertex>();  // with two bytes of padding
  FileNumbers color_numbers = values_of(primitive["attributes"]["COLOR_0"], 5123, "VEC4");
  for (Vertex& color : colors) color = color_numbers.next<Vertex>();
  std::set<std::pair<Vertex, Vertex>> vertices;
  for (size_t i = 0; i < positions.size(); ++i)
    EXPECT_TRUE(vertices.insert({positions[i], colors[i]}).second) << "a vertex comes twice";
  const int index_type = positions.size() < 65536 ? 5123 : 5125;
  FileNumbers indices = values_of(primitive["indices"], index_type, "SCALAR");
  const auto next_index = [&]() -> size_t {
    return index_type == 5123 ? indices.next<uint16_t>() : indices.next<uint32_t>();
  };
  std::map<std::pair<Cell3, int>, Color3> faces;
  rectangles = index_accessor["count"].get<size_t>() / 6;
  for (size_t quad = 0; quad < rectangles; ++quad) {
    std::array<size_t, 6> corner{};
    for (size_t& index : corner) index = next_index();
    EXPECT_TRUE(corner[0] == corner[3] && corner[2] == corner[4]) << "two triangles";
    const Vertex& color = colors.at(corner[0]);
    EXPECT_EQ(color[3], 65535);
    std::array<double, 3> a{}, b{}, low{}, high{};
    low.fill(1e9);
    for (const size_t index : corner) {
      EXPECT_EQ(colors.at(index), color);
      for (size_t i = 0; i < 3; ++i) {
        low[i] = std::min<double>(low[i], positions.at(index)[i]);
        high[i] = std::max<double>(high[i], positions.at(index)[i]);
      }
    }
    for (size_t i = 0; i < 3; ++i) {
      a[i] = double{1} * positions[corner[1]][i] - positions[corner[0]][i];
      b[i] = double{1} * positions[corner[2]][i] - positions[corner[0]][i];
    }
    for (size_t axis = 0; axis < 3; ++axis) {
      const size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
      const double normal = a[u] * b[v] - a[v] * b[u];
      if (normal == 0) continue;
      for (double s = low[u]; s < high[u]; ++s)
        for (double t = low[v]; t < high[v]; ++t) {
          Cell3 cell = region_low;
          cell[u] += static_cast<int64_t>(s);
          cell[v] += static_cast<int64_t>(t);
          cell[axis] += static_cast<int64_t>(low[axis]) - (normal > 0 ? 1 : 0);
          const int direction = 2 * static_cast<int>(axis) + (normal > 0 ? 0 : 1);
          const Color3 of_face = {color[0], color[1], color[2]};
          EXPECT_TRUE(faces.emplace(std::pair(cell, direction), of_face).second) << "a face twice";
        }
    }
  }
  return faces;
}

// Decodes the two files that HashDAG's viewer reads: the DAG and its colors. Like the viewer, finds
// a voxel's color by its index: descends the DAG and counts the voxels before this voxel.
class HashDagColors {
 public:
  HashDagColors(const std::string& dag, const std::string& colors) {
    FileNumbers nodes(dag, 48);
    levels_ = nodes.next<uint32_t>();
    words_.resize(nodes.next<uint64_t>());
    for (uint32_t& word : words_) word = nodes.next<uint32_t>();
    EXPECT_TRUE(nodes.at_end());
    FileNumbers file(colors);
    top_levels_ = file.next<uint32_t>();
    enclosed_.resize(file.next<uint64_t>());
    for (uint64_t& count : enclosed_) count = file.next<uint64_t>();
    colors_.resize(file.next<uint64_t>());
    for (uint32_t& color : colors_) color = file.next<uint32_t>();
    EXPECT_TRUE(file.at_end());
  }
  size_t count() const { return colors_.size(); }

  Color3 color(const Cell3& cell) const {
    uint64_t rank = 0;
    uint32_t node = 0;
    for (uint32_t level = 0; level + 2 < levels_; ++level) {
      const uint32_t child = octant(cell, levels_ - 1 - level);
      uint32_t next = 0;
      for (uint32_t i = 0, at = node + 1; i <= child; ++i) {
        if (!(words_.at(node) >> i & 1)) continue;
        next = words_.at(at++);
        if (i < child) rank += count_of(level + 1, next);
      }
      node = next;
    }
    const uint64_t mask = leaf(node);
    const uint32_t bit = 8 * octant(cell, 1) + octant(cell, 0);
    EXPECT_TRUE(mask >> bit & 1);
    for (uint32_t i = 0; i < bit; ++i) rank += mask >> i & 1;
    const uint32_t color = colors_.at(rank);
    EXPECT_EQ(color >> 24, 255u);
    return {static_cast<int>(color & 255), static_cast<int>(color >> 8 & 255),
            static_cast<int>(color >> 16 & 255)};
  }

 private:
  static uint32_t octant(const Cell3& cell, uint32_t bit) {
    return static_cast<uint32_t>((cell[0] >> bit & 1) * 4 + (cell[1] >> bit & 1) * 2 +
                                 (cell[2] >> bit & 1));
  }
  uint64_t leaf(uint32_t at) const { return words_.at(at) | uint64_t{words_.at(at + 1)} << 32; }
  uint64_t count_of(uint32_t level, uint32_t node) const {
    if (level + 2 == levels_) {
      uint64_t voxels = 0;
      for (uint64_t mask = leaf(node); mask != 0; mask >>= 1) voxels += mask & 1;
      return voxels;
    }
    const uint32_t upper = words_.at(node) >> 8;
    return level < top_levels_ ? enclosed_.at(upper) : upper;
  }

  uint32_t levels_ = 0, top_levels_ = 0;
  std::vector<uint32_t> words_, colors_;
  std::vector<uint64_t> enclosed_;
};

}  // namespace voxdag::query
