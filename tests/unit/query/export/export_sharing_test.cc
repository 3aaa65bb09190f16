// Tests how the files of each format share equal subtrees, and which notes for users the reports
// contain. The scene consists of 64 equal cubes of 256^3 voxels.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "core/format/global/open_global.h"
#include "query/export/export.h"
#include "tests/unit/core/format/test_files.h"
#include "tests/unit/query/export/corners.h"

namespace voxdag::query {
namespace {

constexpr uint32_t kLevels = 10, kTileLevels = 2;

class ExportSharing : public testing::Test {
 protected:
  ExportSharing() {
    write_tiles(folder_.file("a.vdag"), kLevels, kTileLevels);
    file_ = open_global_file(folder_.file("a.vdag"));
  }
  // Exports the file, stores the bytes of the first output file in bytes_, and returns the report.
  ExportReport run(const char* name, uint32_t levels = kLevels) {
    const ExportFormat& format = export_format(name);
    NoProgress progress;
    ExportRequest request{&format,
                          {levels, whole_grid(levels)},
                          folder_.file(std::string("out") + (format.suffix ? format.suffix : ".x")),
                          64 << 20};
    request.replace = true;
    ExportReport report = export_dag(system_files(), *file_, request, progress, CancelToken{});
    bytes_ = read_bytes(report.files[0]);
    return report;
  }
  size_t count(const std::string& text) const {
    size_t found = 0;
    for (size_t at = bytes_.find(text); at != std::string::npos; at = bytes_.find(text, at + 1))
      ++found;
    return found;
  }
  TemporaryFolder folder_;
  std::unique_ptr<voxdag_reader::File> file_;
  std::string bytes_;
};

TEST_F(ExportSharing, VoxHasOneModelAndItsPlaces) {
  const ExportReport report = run("vox");
  EXPECT_EQ(count("SIZE"), 1u);
  EXPECT_EQ(count("XYZI"), 1u);
  EXPECT_EQ(count("nSHP"), 64u);
  EXPECT_EQ(report.notes,
            std::vector<std::string>{"z is up: a voxel (x, y, z) is at (x, -z, y); 64 instances"});
}

// An exported file has one word for the root and one word for each child pointer of the DAG. This
// count shows that equal subtrees are exported once.
TEST_F(ExportSharing, PlayCanvasVoxelsHaveOneWordForEachPointer) {
  EXPECT_EQ(run("voxel").notes, std::vector<std::string>{});
  const auto json = nlohmann::json::parse(bytes_);
  const uint32_t chain = kLevels - 2 - kTileLevels;  // number of nodes with only one child
  EXPECT_EQ(json["nodeCount"], 1 + 8 * kTileLevels + chain);
  EXPECT_EQ(json["numInteriorNodes"], kTileLevels + chain);
  EXPECT_EQ(json["numMixedLeaves"], 1);
  EXPECT_EQ(json["leafDataCount"], 2);
}

// Each node of the DAG is exported once: the files have exactly the words that its nodes take in
// each format.
TEST_F(ExportSharing, HashDagAndSvdagHaveTheNodesOfTheFile) {
  const uint64_t words = 9 * kTileLevels + 2 * (kLevels - 2 - kTileLevels);
  run("hashdag");
  EXPECT_EQ(bytes_.size(), 60 + 4 * (words + 2));
  run("svdag");
  EXPECT_EQ(bytes_.size(), 44 + 4 * (words + 2 + 255));
}

TEST_F(ExportSharing, NotesSayWhatToSet) {
  const std::string set = ", LOAD_UNCOMPRESSED_COLORS 1 and LOAD_COMPRESSED_COLORS 0";
  EXPECT_EQ(run("hashdag").notes,
            std::vector<std::string>{"compile the viewer with SCENE_DEPTH 10" + set +
                                     ", and name the files data/<SCENE>1k.basic_dag.*"});
  EXPECT_EQ(run("hashdag", 9).notes,
            std::vector<std::string>{"the viewer of HashDAG takes grids of 1024 voxels per edge or "
                                     "more; its loader reads this file"});
  EXPECT_EQ(run("svdag").notes, std::vector<std::string>{});
  const std::vector<std::string> bt = run("bt").notes;
  ASSERT_EQ(bt.size(), 2u);
  EXPECT_EQ(bt[0],
            "its coordinates are those of the scene, up to half a voxel: add 0, 0, 0 for the exact "
            "ones");
  EXPECT_TRUE(bt[1].starts_with("its readers need about ")) << bt[1];
  EXPECT_EQ(run("ply").notes, std::vector<std::string>{});
  EXPECT_EQ(run("npz").notes, std::vector<std::string>{
                                  "numpy.load() gives 'cells' (int32), 'positions' (their centers, "
                                  "float64) and 'grid' (low corner of the grid and edge of a "
                                  "voxel)"});
  EXPECT_EQ(run("glb").notes,
            std::vector<std::string>{"384 rectangles, 768 triangles, 512 vertices"});
}

}  // namespace
}  // namespace voxdag::query
