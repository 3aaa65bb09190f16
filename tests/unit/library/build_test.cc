// Uses only the public headers, as other programs do: builds from arrays, hooks, errors and
// queries.
#include "voxdag/build.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "tests/support/temporary_folder.h"
#include "voxdag/query.h"

namespace voxdag {
namespace {

using query::DagFile;

std::string contents(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

// Two triangles that share an edge, with a color at each vertex.
const std::vector<double> kPositions = {0, 0, 0, 4, 0, 0.5, 4, 4, 1, 0, 4, 1.0 / 3};
const std::vector<uint32_t> kIndices = {0, 1, 2, 0, 2, 3};
const std::vector<uint8_t> kColors = {255, 0, 0,   255, 0,   255, 0, 255,
                                      0,   0, 255, 255, 255, 255, 0, 255};

class LibraryBuild : public testing::Test {
 protected:
  BuildOptions options(const std::string& name) const {
    BuildOptions options;
    options.mesh = Mesh{kPositions, kIndices};
    options.resolution = 64;
    options.output = folder_.file(name);
    options.threads = 2;
    options.memory_bytes = uint64_t{256} << 20;
    return options;
  }
  // Writes the same mesh as a PLY file, and returns its path.
  std::string ply() const {
    const std::string path = folder_.file("mesh.ply");
    std::ofstream file(path);
    file << "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double "
            "y\nproperty "
            "double z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty "
            "uchar "
            "alpha\nelement face 2\nproperty list uchar uint vertex_indices\nend_header\n";
    file.precision(17);
    for (size_t i = 0; i < 4; ++i) {
      for (size_t axis = 0; axis < 3; ++axis) file << kPositions[3 * i + axis] << ' ';
      for (size_t c = 0; c < 4; ++c) file << int{kColors[4 * i + c]} << ' ';
      file << '\n';
    }
    file << "3 0 1 2\n3 0 2 3\n";
    return path;
  }

  TemporaryFolder folder_;
};

TEST_F(LibraryBuild, AMeshEqualsItsFile) {
  BuildOptions from_file = options("file.vdag");
  from_file.mesh.reset();
  from_file.scenes = {ply()};
  from_file.color = true;
  const BuildResult expected = build(from_file);
  EXPECT_EQ(expected.triangles, 2u);

  BuildOptions from_mesh = options("mesh.vdag");
  from_mesh.mesh->colors = kColors;
  from_mesh.color = true;
  const BuildResult result = build(from_mesh);
  EXPECT_EQ(result.sha256, expected.sha256);
  EXPECT_EQ(contents(from_mesh.output), contents(from_file.output));
  EXPECT_EQ(result.bytes, contents(from_mesh.output).size());
  EXPECT_NE(result.json.find(result.sha256), std::string::npos);

  const DagFile dag(from_mesh.output);
  EXPECT_EQ(dag.voxels(), result.voxels);
  EXPECT_EQ(dag.dag_nodes(), result.dag_nodes);
  EXPECT_EQ(dag.origin(), result.origin);
  EXPECT_EQ(dag.edge(), result.edge);
  EXPECT_TRUE(dag.has_colors());
}

// Coordinates that floats represent exactly give the same file as floats and as doubles.
TEST_F(LibraryBuild, Floats) {
  const std::vector<double> doubles = {0, 0, 0, 4, 0, 0.5, 4, 4, 1};
  const std::vector<float> floats(doubles.begin(), doubles.end());
  const std::vector<uint32_t> indices = {0, 1, 2};
  BuildOptions one = options("floats.vdag"), other = options("doubles.vdag");
  one.mesh = Mesh{floats, indices};
  other.mesh = Mesh{doubles, indices};
  EXPECT_EQ(build(one).sha256, build(other).sha256);
}

TEST_F(LibraryBuild, FilesAndAMeshAreOneScene) {
  BuildOptions both = options("both.vdag");
  both.scenes = {ply()};
  const BuildResult result = build(both);
  EXPECT_EQ(result.triangles, 4u);
  EXPECT_EQ(result.sha256.size(), 64u);
}

TEST_F(LibraryBuild, RefusesBadMeshes) {
  const auto message_of = [&](const Mesh& mesh, bool skip_invalid) -> std::string {
    BuildOptions bad = options("bad.vdag");
    bad.mesh = mesh;
    bad.skip_invalid = skip_invalid;
    try {
      return std::to_string(build(bad).dropped_invalid) + " dropped";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
      return error.message();
    }
  };
  const std::vector<uint32_t> out_of_range = {0, 1, 2, 0, 1, 4};
  EXPECT_NE(message_of({kPositions, out_of_range}, false).find("index 4"), std::string::npos);
  EXPECT_EQ(message_of({kPositions, out_of_range}, true), "1 dropped");
  const std::span<const double> positions(kPositions);
  const std::span<const uint32_t> indices(kIndices);
  const std::span<const uint8_t> colors(kColors);
  EXPECT_NE(message_of({positions.first(11), indices}, true).find("11 coordinates"),
            std::string::npos);
  EXPECT_NE(message_of({positions, indices.first(5)}, true).find("5 vertex numbers"),
            std::string::npos);
  EXPECT_NE(message_of({positions, indices, colors.first(12)}, true).find("12 color channels"),
            std::string::npos);
}

TEST_F(LibraryBuild, Hooks) {
  std::vector<std::string> stages, warnings;
  BuildHooks hooks;
  hooks.on_progress = [&](const BuildProgress& progress) { stages.emplace_back(progress.stage); };
  hooks.on_warning = [&](std::string_view message) { warnings.emplace_back(message); };
  BuildOptions empty = options("empty.vdag");
  empty.mesh = Mesh{std::span<const float>{}, {}};
  EXPECT_THROW(build(empty), Error);
  empty.allow_empty = true;
  const BuildResult result = build(empty, hooks);
  EXPECT_EQ(result.voxels, 0u);
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_EQ(result.warnings[0].code, "empty-scene");
  EXPECT_FALSE(stages.empty());
  EXPECT_FALSE(warnings.empty()) << "a scene without triangles is worth a warning";

  CancelToken canceled;
  canceled.cancel();
  hooks.cancel = &canceled;
  try {
    build(options("canceled.vdag"), hooks);
    FAIL() << "it was built";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCanceled);
  }
  EXPECT_FALSE(std::ifstream(folder_.file("canceled.vdag")).good());
}

TEST_F(LibraryBuild, Plans) {
  const BuildPlan estimate = plan(options("planned.vdag"));
  EXPECT_EQ(estimate.triangles, 2u);
  EXPECT_LE(estimate.voxels.low, estimate.voxels.high);
  EXPECT_GT(estimate.file_bytes.likely, 0);
  EXPECT_FALSE(std::ifstream(folder_.file("planned.vdag")).good());
}

TEST_F(LibraryBuild, QueriesInTheUnitsOfTheScene) {
  const BuildOptions built = options("world.vdag");
  build(built);
  const DagFile dag(built.output);
  const query::Position corner = dag.world_to_cell({4, 0, 0.5}, dag.grid_levels());
  uint8_t set = 0;
  dag.lookup({&corner, 1}, dag.grid_levels(), {&set, 1});
  EXPECT_EQ(set, 1);
  const query::Region whole =
      dag.world_to_region({-INFINITY, -INFINITY, -INFINITY}, {INFINITY, INFINITY, INFINITY}, 3);
  EXPECT_EQ(whole, query::whole_grid(3));
  EXPECT_EQ(dag.tile(3, 0, 0).front(), 0x31544456u);  // "VDT1"
  EXPECT_THROW(dag.tile(3, 0, 12345), Error);
  EXPECT_THROW(dag.tile(9, 0, 0), Error);
}

}  // namespace
}  // namespace voxdag
