// In an exported mesh, each selected cell is a hexahedron, and each corner of selected cells is one
// point, even if several cells share it.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <set>
#include <sstream>

#include "core/format/global/open_global.h"
#include "query/export/export.h"
#include "tests/unit/core/format/test_files.h"

namespace voxdag::query {
namespace {

using MeshPoint = std::array<double, 3>;
struct DecodedMesh {
  std::vector<MeshPoint> points;
  std::vector<std::array<size_t, 8>> cells;
};

// Returns the bytes of an array in the appended data of a .vtu file.
std::string vtu_array(const std::string& file, const std::string& name) {
  const size_t begin = file.find("\n_") + 2;
  const size_t tag = file.find("Name=\"" + name + "\"");
  const size_t offset = begin + std::stoull(file.substr(file.find("offset=\"", tag) + 8));
  uint64_t size = 0;
  std::memcpy(&size, &file[offset], sizeof size);
  return file.substr(offset + sizeof size, size);
}

template <class T>
std::vector<T> numbers_of(const std::string& bytes) {
  std::vector<T> numbers(bytes.size() / sizeof(T));
  std::memcpy(numbers.data(), bytes.data(), bytes.size());
  return numbers;
}

DecodedMesh decode_vtu(const std::string& file) {
  DecodedMesh mesh;
  const auto points = numbers_of<double>(vtu_array(file, "Points"));
  for (size_t i = 0; i + 3 <= points.size(); i += 3)
    mesh.points.push_back({points[i], points[i + 1], points[i + 2]});
  const auto corners = numbers_of<int64_t>(vtu_array(file, "connectivity"));
  for (size_t i = 0; i + 8 <= corners.size(); i += 8) {
    auto& cell = mesh.cells.emplace_back();
    for (size_t c = 0; c < 8; ++c) cell[c] = static_cast<size_t>(corners[i + c]);
  }
  const auto offsets = numbers_of<int64_t>(vtu_array(file, "offsets"));
  EXPECT_EQ(offsets.size(), mesh.cells.size());
  for (size_t i = 0; i < offsets.size(); ++i)
    EXPECT_EQ(offsets[i], static_cast<int64_t>(8 * i + 8));
  EXPECT_EQ(vtu_array(file, "types"), std::string(mesh.cells.size(), 12));
  return mesh;
}

DecodedMesh decode_inp(const std::string& file) {
  DecodedMesh mesh;
  std::istringstream lines(file);
  std::string section;
  for (std::string line; std::getline(lines, line);) {
    if (line[0] == '*') {
      section = line.substr(0, line.find(','));
      continue;
    }
    std::vector<double> numbers;
    std::istringstream words(line);
    for (std::string word; std::getline(words, word, ',');)
      if (section != "*HEADING") numbers.push_back(std::stod(word));
    if (section == "*NODE") {
      mesh.points.push_back({numbers.at(1), numbers.at(2), numbers.at(3)});
      EXPECT_EQ(numbers[0], static_cast<double>(mesh.points.size()));
    } else if (section == "*ELEMENT") {
      auto& cell = mesh.cells.emplace_back();
      for (size_t c = 0; c < 8; ++c) cell[c] = static_cast<size_t>(numbers.at(c + 1)) - 1;
      EXPECT_EQ(numbers[0], static_cast<double>(mesh.cells.size()));
    }
  }
  return mesh;
}

class ExportMesh : public testing::TestWithParam<std::string> {
 protected:
  static constexpr int kEdge = 64;
  DecodedMesh exported(const oracle::Voxels& voxels, const Selection& selection) {
    write_global(folder_.file("a.vdag"), voxels);
    const auto file = open_global_file(folder_.file("a.vdag"));
    const std::string output = folder_.file("out");
    NoProgress progress;
    const ExportReport report =
        export_dag(system_files(), *file,
                   {&export_format(GetParam()), selection, output, uint64_t{64} << 20, false, true},
                   progress, CancelToken{});
    EXPECT_EQ(report.bytes, read_bytes(output).size());
    const DecodedMesh mesh =
        GetParam() == "vtu" ? decode_vtu(read_bytes(output)) : decode_inp(read_bytes(output));
    EXPECT_EQ(report.voxels, mesh.cells.size());
    return mesh;
  }
  // Exports the selection of a file with these voxels. Checks that the mesh has a hexahedron for
  // each selected cell, and no unused or duplicate points.
  void expect_mesh(const oracle::Voxels& voxels, const Selection& selection) {
    const DecodedMesh mesh = exported(voxels, selection);
    const int size = kEdge >> selection.grid_levels;
    const Grid grid = grid_of(kEdge);
    const double edge = grid.edge / (1 << selection.grid_levels);
    using Place = std::array<int64_t, 3>;
    std::set<Place> cells, corners;
    const Region& region = selection.region;
    for (int64_t x = 0; x < kEdge; ++x)
      for (int64_t y = 0; y < kEdge; ++y)
        for (int64_t z = 0; z < kEdge; ++z) {
          const Place cell = {x / size, y / size, z / size};
          if (voxels.at(static_cast<int>(x), static_cast<int>(y), static_cast<int>(z)) &&
              region.contains(cell, 1))
            cells.insert(cell);
        }
    std::vector<Place> points;
    for (const MeshPoint& point : mesh.points) {
      Place& place = points.emplace_back();
      for (size_t axis = 0; axis < 3; ++axis) {
        const double position = (point[axis] - grid.origin[axis]) / edge;
        place[axis] = std::llround(position);
        EXPECT_NEAR(position, static_cast<double>(place[axis]), 1e-9);
      }
      EXPECT_TRUE(corners.insert(place).second) << "a point comes twice";
    }
    const Place offsets[8] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0},
                              {0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}};
    std::set<Place> found, used;
    for (const auto& cell : mesh.cells) {
      const Place low = points.at(cell[0]);
      for (size_t c = 0; c < 8; ++c) {
        const Place expected = {low[0] + offsets[c][0], low[1] + offsets[c][1],
                                low[2] + offsets[c][2]};
        EXPECT_EQ(points.at(cell[c]), expected);
        used.insert(expected);
      }
      EXPECT_TRUE(found.insert(low).second) << "a cell comes twice";
    }
    EXPECT_TRUE(found == cells);
    EXPECT_TRUE(used == corners);
  }

  TemporaryFolder folder_;
};

TEST_P(ExportMesh, HasTheSelectedCells) {
  const oracle::Voxels voxels = random_voxels(5, kEdge);
  expect_mesh(voxels, {6, whole_grid(6)});
  expect_mesh(voxels, {4, whole_grid(4)});
  expect_mesh(voxels, {2, whole_grid(2)});
  expect_mesh(voxels, {6, {{3, 0, 7}, {62, 61, 60}}});
  expect_mesh(voxels, {5, {{5, 2, 1}, {31, 32, 30}}});
}

// A solid cube of n^3 voxels has (n + 1)^3 points, also at the border of the grid.
TEST_P(ExportMesh, SharesPoints) {
  for (const int low : {0, 3, 44}) {
    oracle::Voxels cube(kEdge);
    for (int x = low; x < low + 20; ++x)
      for (int y = low; y < low + 20; ++y)
        for (int z = low; z < low + 20; ++z) cube.set(x, y, z);
    EXPECT_EQ(exported(cube, {6, whole_grid(6)}).points.size(), 21u * 21 * 21);
    expect_mesh(cube, {6, whole_grid(6)});
  }
}

// Exports voxels at opposite corners of the grid, and voxels that share only an edge or a corner.
TEST_P(ExportMesh, SparseVoxels) {
  oracle::Voxels voxels(kEdge);
  for (const int at : {0, 3, 4, 63}) voxels.set(at, at, at);
  voxels.set(4, 4, 3);
  voxels.set(4, 3, 5);
  expect_mesh(voxels, {6, whole_grid(6)});
}

std::string name_of_mesh(const testing::TestParamInfo<std::string>& format) { return format.param; }
INSTANTIATE_TEST_SUITE_P(Formats, ExportMesh, testing::Values("vtu", "inp"), name_of_mesh);

}  // namespace
}  // namespace voxdag::query
