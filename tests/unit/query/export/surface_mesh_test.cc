// Tests the meshes of --outside and --watertight: a simple flood finds the faces that are visible
// from outside, and a count of edges shows that a mesh is closed.
#include "query/export/surface/surface_mesh.h"

#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "core/base/error.h"
#include "core/format/global/open_global.h"
#include "query/export/chunks/export_chunks.h"
#include "query/export/outside/filled_dag.h"
#include "query/lookup/bricks.h"
#include "tests/support/error_of.h"
#include "tests/unit/query/export/corners.h"
#include "tests/unit/query/query_files.h"

namespace voxdag::query {
namespace {

using SurfacePoint = std::array<int64_t, 3>;

struct SurfaceTriangles {
  std::vector<SurfacePoint> vertices;
  std::vector<std::array<uint32_t, 3>> triangles;
};

// Decodes a .glb file. `low` is the low corner of the region.
SurfaceTriangles decode_surface(const std::string& bytes, const Position& low) {
  const auto number = [&](auto value, size_t at) {
    std::memcpy(&value, &bytes.at(at), sizeof(value));
    return value;
  };
  const auto json_size = number(uint32_t{}, 12);
  const auto document = nlohmann::json::parse(bytes.substr(20, json_size));
  SurfaceTriangles mesh;
  if (!document.contains("meshes")) return mesh;
  const auto& accessors = document["accessors"];
  const size_t binary = 28 + json_size;
  const auto offset = [&](size_t view) {
    return binary + document["bufferViews"][view]["byteOffset"].get<size_t>();
  };
  const bool is_short = accessors[0]["componentType"] == 5123;
  for (size_t i = 0; i < accessors[0]["count"]; ++i) {
    SurfacePoint& point = mesh.vertices.emplace_back(low);
    for (size_t axis = 0; axis < 3; ++axis)
      point[axis] += is_short
                         ? number(uint16_t{}, offset(0) + 8 * i + 2 * axis)
                         : static_cast<int64_t>(number(float{}, offset(0) + 12 * i + 4 * axis));
  }
  const bool has_short_indices = accessors[1]["componentType"] == 5123;
  for (size_t i = 0; i < accessors[1]["count"]; ++i) {
    if (i % 3 == 0) mesh.triangles.emplace_back();
    mesh.triangles.back()[i % 3] = has_short_indices ? number(uint16_t{}, offset(1) + 2 * i)
                                                     : number(uint32_t{}, offset(1) + 4 * i);
  }
  return mesh;
}

using Face = std::pair<Position, int>;  // a cell, and the direction 2 * axis + (1 if upward)

Position next_cell(Position cell, int direction) {
  cell[static_cast<size_t>(direction / 2)] += direction % 2 != 0 ? 1 : -1;
  return cell;
}

// Returns the faces that the triangles cover. Checks with sample points that each of these faces is
// covered completely and only once.
std::set<Face> covered_faces(const SurfaceTriangles& mesh) {
  std::map<Face, double> covered;
  for (const auto& triangle : mesh.triangles) {
    const SurfacePoint &a = mesh.vertices[triangle[0]], &b = mesh.vertices[triangle[1]],
                       &c = mesh.vertices[triangle[2]];
    size_t axis = 0;
    while (a[axis] != b[axis] || a[axis] != c[axis]) ++axis;
    const size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
    const int64_t area = (b[u] - a[u]) * (c[v] - a[v]) - (b[v] - a[v]) * (c[u] - a[u]);
    EXPECT_NE(area, 0) << "a degenerate triangle";
    // Finds the sample points that are in the triangle. The sample points are at places through
    // which no edge of a small triangle with integer corners passes.
    constexpr int kSamples = 7;
    const auto side = [&](const SurfacePoint& p, const SurfacePoint& q, double s, double t) {
      return (static_cast<double>(q[u] - p[u]) * (t - static_cast<double>(p[v])) -
              static_cast<double>(q[v] - p[v]) * (s - static_cast<double>(p[u]))) *
             (area > 0 ? 1 : -1);
    };
    const auto [u0, u1] = std::minmax({a[u], b[u], c[u]});
    const auto [v0, v1] = std::minmax({a[v], b[v], c[v]});
    for (int64_t s = u0; s < u1; ++s)
      for (int64_t t = v0; t < v1; ++t)
        for (int k = 0; k < kSamples * kSamples; ++k) {
          const double x = static_cast<double>(s) + (k / kSamples + 0.4142135) / kSamples;
          const double y = static_cast<double>(t) + (k % kSamples + 0.7320508) / kSamples;
          if (side(a, b, x, y) < 0 || side(b, c, x, y) < 0 || side(c, a, x, y) < 0) continue;
          Position cell{};
          cell[axis] = a[axis] - (area > 0 ? 1 : 0);
          cell[u] = s;
          cell[v] = t;
          covered[{cell, static_cast<int>(2 * axis) + (area > 0)}] += 1.0 / (kSamples * kSamples);
        }
  }
  std::set<Face> faces;
  for (const auto& [face, share] : covered) {
    EXPECT_NEAR(share, 1, 1e-9);
    faces.insert(face);
  }
  return faces;
}

class SurfaceMeshTest : public testing::Test {
 protected:
  static constexpr int kEdge = 32;
  // Two closed boxes, one in the other; a box with a hole; and scattered voxels.
  SurfaceMeshTest() : voxels_(kEdge) {
    add_box(2, 14);
    add_box(5, 9);
    add_box(17, 30);
    for (int y = 22; y < 25; ++y) clear_.insert({17, y, 20});
    for (int i = 0; i < 60; ++i) voxels_.set(i * 7 % 32, i * 11 % 32, i * i % 32);
    oracle::Voxels open(kEdge);
    for (int x = 0; x < kEdge; ++x)
      for (int y = 0; y < kEdge; ++y)
        for (int z = 0; z < kEdge; ++z)
          if (voxels_.at(x, y, z) && !clear_.contains({x, y, z})) open.set(x, y, z);
    voxels_ = open;
    scene_.emplace(voxels_);
    file_ = open_global_file(scene_->path());
  }
  void add_box(int low, int high) {
    for (int x = low; x <= high; ++x)
      for (int y = low; y <= high; ++y)
        for (int z = low; z <= high; ++z)
          if (x == low || x == high || y == low || y == high || z == low || z == high)
            voxels_.set(x, y, z);
  }
  std::set<Position> cells(uint32_t levels) const {
    std::set<Position> found;
    for_each_brick(DagView(*file_), {levels, whole_grid(levels)}, [&](const Brick& brick) {
      for_each_cell_of(brick, [&](const Position& cell) { found.insert(cell); });
    });
    return found;
  }
  // Returns the empty cells, including a layer around the grid, that are connected with the cells
  // around the grid.
  static std::set<Position> flooded(const std::set<Position>& set, int64_t edge) {
    std::set<Position> outside = {{-1, -1, -1}};
    std::vector<Position> next = {{-1, -1, -1}};
    while (!next.empty()) {
      const Position at = next.back();
      next.pop_back();
      for (int direction = 0; direction < 6; ++direction) {
        const Position to = next_cell(at, direction);
        const bool is_in = std::ranges::all_of(to, [&](int64_t c) { return c >= -1 && c <= edge; });
        if (is_in && !set.contains(to) && outside.insert(to).second) next.push_back(to);
      }
    }
    return outside;
  }
  // Returns the faces of the region's cells toward the cells for which is_empty() is true.
  template <class IsEmpty>
  static std::set<Face> expected(const std::set<Position>& set, const Region& region,
                                 const IsEmpty& is_empty) {
    std::set<Face> faces;
    for (const Position& cell : set)
      for (int direction = 0; direction < 6; ++direction)
        if (region.contains(cell, 1) && is_empty(next_cell(cell, direction)))
          faces.insert({cell, direction});
    return faces;
  }
  ExportRequest request(uint32_t levels, const Region& region) const {
    ExportRequest request{&export_format("glb"), {levels, region}, folder_.file("a.glb"), 64 << 20};
    request.replace = true;
    request.options = options_;
    return request;
  }
  SurfaceTriangles exported(uint32_t levels, const Region& region) {
    NoProgress progress;
    report_ = export_dag(system_files(), *file_, request(levels, region), progress, CancelToken{});
    return decode_surface(read_bytes(folder_.file("a.glb")), region.low);
  }
  // Checks that each edge of the mesh is used as often in one direction as in the other: once, or
  // twice if two cells have only this edge in common.
  static void expect_closed(const SurfaceTriangles& mesh) {
    std::map<std::pair<uint32_t, uint32_t>, int> edges;
    for (const auto& triangle : mesh.triangles)
      for (size_t i = 0; i < 3; ++i) ++edges[{triangle[i], triangle[(i + 1) % 3]}];
    for (const auto& [edge, count] : edges) {
      const auto reversed = edges.find({edge.second, edge.first});
      ASSERT_TRUE(reversed != edges.end()) << "an open edge";
      ASSERT_EQ(count, reversed->second);
      ASSERT_LE(count, 2);
    }
  }

  oracle::Voxels voxels_;
  std::set<Position> clear_;
  std::optional<QueryFile> scene_;
  std::unique_ptr<voxdag_reader::File> file_;
  TemporaryFolder folder_;
  ExportOptions options_;
  ExportReport report_;
};

const Region kPartOfMesh = {{3, 1, 4}, {29, 27, 32}};

TEST_F(SurfaceMeshTest, AllFacesAreCoveredOnce) {
  for (const bool watertight : {false, true})
    for (const uint32_t levels : {5u, 4u, 2u})
      for (const Region& region : {whole_grid(levels), kPartOfMesh}) {
        if (levels < 5 && region == kPartOfMesh) continue;
        options_.watertight = watertight;
        const std::set<Position> set = cells(levels);
        EXPECT_TRUE(covered_faces(exported(levels, region)) ==
                    expected(set, region, [&](const Position& next) {
                      return !set.contains(next) || !region.contains(next, 1);
                    }));
      }
}

TEST_F(SurfaceMeshTest, VerticesAreShared) {
  const SurfaceTriangles mesh = exported(5, whole_grid(5));
  EXPECT_EQ(std::set<SurfacePoint>(mesh.vertices.begin(), mesh.vertices.end()).size(),
            mesh.vertices.size());
  EXPECT_LT(2 * mesh.vertices.size(), 4 * mesh.triangles.size());
}

TEST_F(SurfaceMeshTest, WatertightMeshesAreClosed) {
  options_.watertight = true;
  for (const bool outside : {false, true}) {
    options_.outside = outside;
    for (const uint32_t levels : {5u, 4u, 3u}) expect_closed(exported(levels, whole_grid(levels)));
  }
  options_.outside = false;
  expect_closed(exported(5, kPartOfMesh));
}

// The two diagonal voxels have one edge in common, which four triangles use. Every other edge has
// two triangles.
TEST_F(SurfaceMeshTest, AnEdgeOfTwoVoxelsHasFourTriangles) {
  oracle::Voxels two(4);
  two.set(0, 0, 0);
  two.set(1, 1, 0);
  scene_.emplace(two);
  file_ = open_global_file(scene_->path());
  options_.watertight = true;
  const SurfaceTriangles mesh = exported(2, whole_grid(2));
  std::map<std::pair<uint32_t, uint32_t>, int> edges;
  for (const auto& t : mesh.triangles)
    for (size_t i = 0; i < 3; ++i) ++edges[std::minmax(t[i], t[(i + 1) % 3])];
  EXPECT_EQ(std::ranges::count(edges, 4, [](const auto& edge) { return edge.second; }), 1);
  EXPECT_EQ(std::ranges::count(edges, 2, [](const auto& edge) { return edge.second; }),
            static_cast<ptrdiff_t>(edges.size()) - 1);
}

TEST_F(SurfaceMeshTest, OutsideHasTheFacesThatAFloodReaches) {
  options_.outside = true;
  for (const uint32_t levels : {5u, 4u}) {
    const std::set<Position> set = cells(levels);
    const std::set<Position> outside = flooded(set, int64_t{1} << levels);
    const auto is_outside = [&](const Position& next) { return outside.contains(next); };
    for (const UpAxis up : {UpAxis::kY, UpAxis::kZ}) {
      options_.up = up;
      const std::set<Face> seen = covered_faces(exported(levels, whole_grid(levels)));
      EXPECT_EQ(report_.voxels, set.size());
      if (up == UpAxis::kZ)
        EXPECT_EQ(seen.size(), expected(set, whole_grid(levels), is_outside).size());
      else
        EXPECT_TRUE(seen == expected(set, whole_grid(levels), is_outside));
    }
  }
}

// In an export of a region, `outside` refers to the complete grid. So the border of the region has
// no faces.
TEST_F(SurfaceMeshTest, OutsideOfARegionIsThatOfTheGrid) {
  options_.outside = true;
  const std::set<Position> set = cells(5), outside = flooded(set, 32);
  for (const Region& region : {kPartOfMesh, Region{{5, 5, 5}, {10, 10, 10}}})
    EXPECT_TRUE(
        covered_faces(exported(5, region)) ==
        expected(set, region, [&](const Position& next) { return outside.contains(next); }));
  EXPECT_EQ(report_.facts[1].second[0], 0) << "the inner box is not visible";
}

TEST_F(SurfaceMeshTest, ChunksHaveTheOutsideOfTheGrid) {
  options_.outside = true;
  ExportRequest all = request(5, whole_grid(5));
  all.output = folder_.file("chunks");
  NoProgress progress;
  export_chunks(system_files(), *file_, {all, 8, 2}, progress, CancelToken{});
  const auto manifest =
      nlohmann::json::parse(read_bytes(folder_.file("chunks") + "/manifest.json"));
  for (const auto& level : manifest["levels"]) {
    std::set<Face> found;
    for (const auto& chunk : level["chunks"])
      found.merge(covered_faces(decode_surface(
          read_bytes(folder_.file("chunks") + "/" + chunk["files"][0]["path"].get<std::string>()),
          chunk["low"].get<Position>())));
    const auto levels = level["level"].get<uint32_t>();
    const std::set<Position> set = cells(levels);
    const std::set<Position> outside = flooded(set, int64_t{1} << levels);
    EXPECT_TRUE(found == expected(set, whole_grid(levels),
                                  [&](const Position& next) { return outside.contains(next); }));
  }
}

// Positions over 65535 are floats.
TEST_F(SurfaceMeshTest, LargeGridsHaveFloats) {
  write_corners(folder_.file("corners.vdag"), 18);
  file_ = open_global_file(folder_.file("corners.vdag"));
  const SurfaceTriangles mesh = exported(18, whole_grid(18));
  ASSERT_EQ(mesh.vertices.size(), 16u);
  for (const SurfacePoint& point : mesh.vertices)
    for (const int64_t coordinate : point)
      EXPECT_TRUE(coordinate < 2 || coordinate > (1 << 18) - 2) << coordinate;
  EXPECT_EQ(read_bytes(folder_.file("a.glb")).find("KHR_"), std::string::npos);
}

TEST_F(SurfaceMeshTest, FillingNeedsMemory) {
  MemoryBudget little(1000);
  EXPECT_THROW(FilledDag(DagView(*file_), 5, "a.vdag", little, CancelToken{}), Error);
}

TEST_F(SurfaceMeshTest, FillingCanBeCanceled) {
  MemoryBudget budget(64 << 20);
  CancelToken canceled;
  canceled.cancel();
  EXPECT_EQ(error_of([&] { FilledDag(DagView(*file_), 5, "a.vdag", budget, canceled); }).code(),
            ErrorCode::kCanceled);
}

TEST_F(SurfaceMeshTest, OtherFormatsHaveNoSuchOptions) {
  ExportRequest request = this->request(5, whole_grid(5));
  request.format = &export_format("ply");
  request.options.watertight = true;
  NoProgress progress;
  EXPECT_THROW(export_dag(system_files(), *file_, request, progress, CancelToken{}), Error);
}

}  // namespace
}  // namespace voxdag::query
