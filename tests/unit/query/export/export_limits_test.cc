// An export is refused if the format or the memory cannot hold the selection. The message names the
// size and a selection that fits, and no files remain. The scenes are full cubes, whose files are
// small for any grid.
#include <gtest/gtest.h>

#include <bit>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/format/global/global_writer.h"
#include "core/format/global/open_global.h"
#include "query/export/export.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/query/export/stages.h"

using namespace voxdag;
using namespace voxdag::query;

namespace {

class ExportLimits : public ::testing::Test {
 protected:
  // Writes and opens a file in which every brick has the voxels of `mask`; by default, all voxels
  // are set.
  std::unique_ptr<voxdag_reader::File> full_grid(uint32_t levels, uint64_t mask = ~uint64_t{0}) {
    const std::string path = folder_.file("full.vdag");
    GlobalFileWriter writer(system_files(), path, Grid::given({0, 0, 0}, 1, levels), 64);
    const std::vector<uint32_t> brick = {static_cast<uint32_t>(mask),
                                         static_cast<uint32_t>(mask >> 32)},
                                node = {0xff, 0, 0, 0, 0, 0, 0, 0, 0};
    uint64_t svo_nodes = 0;
    for (uint32_t level = levels - 1; level-- > 0;) {
      const std::vector<uint32_t>& words = level + 2 == levels ? brick : node;
      writer.begin_level(level);
      writer.checksum_words(words);
      writer.write_words(0, words);
      writer.end_level({1, words.size()});
      svo_nodes += uint64_t{1} << 3 * level;
    }
    writer.finish({static_cast<uint64_t>(std::popcount(mask)) << 3 * (levels - 2), svo_nodes});
    return open_global_file(path);
  }

  // Expects that an export of the complete file is refused with this code and leaves no files.
  // Returns the message.
  std::string refusal(const voxdag_reader::File& file, const std::string& format,
                      const std::string& output, ErrorCode code, uint64_t memory_bytes) {
    const Selection all{file.grid_levels(), whole_grid(file.grid_levels())};
    return refusal(file, all, format, output, code, memory_bytes);
  }
  std::string refusal(const voxdag_reader::File& file, const Selection& selection,
                      const std::string& format, const std::string& output, ErrorCode code,
                      uint64_t memory_bytes) {
    NoProgress progress;
    const CancelToken cancel;
    ExportRequest request{&export_format(format), selection, folder_.file(output), memory_bytes};
    request.options = options_;
    try {
      export_dag(system_files(), file, request, progress, cancel);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), code) << error.message();
      EXPECT_EQ(system_files().list(folder_.path()).size(), 1u) << "only the input is there";
      return error.message();
    }
    ADD_FAILURE() << format << " took what it cannot hold";
    return "";
  }

  static constexpr uint64_t kMemory = 64 << 20;
  TemporaryFolder folder_;
  ExportOptions options_;  // for the exports of refusal()
};

// If the export of a region is refused, the message names a coarser level that fits, and the region
// in cells of that level.
TEST_F(ExportLimits, TheRegionThatFitsIsNamed) {
  const Selection part{11, {{3, 4, 5}, {2047, 1025, 2000}}};
  const std::string message =
      refusal(*full_grid(11), part, "ply", "a.ply", ErrorCode::kLimit, kMemory);
  EXPECT_NE(message.find("--level 10 --region 1,2,2,1024,513,1000 (1024 voxels per edge) fits"),
            std::string::npos)
      << message;
}

// The export names the level that fits, however little memory the search for it has.
TEST_F(ExportLimits, PlyNamesTheLevelThatFits) {
  const auto file = full_grid(11);
  for (const uint64_t memory_bytes : {kMemory, uint64_t{8}}) {
    const std::string message = refusal(*file, "ply", "a.ply", ErrorCode::kLimit, memory_bytes);
    EXPECT_NE(message.find("8 589 934 592 voxels"), std::string::npos) << message;
    EXPECT_NE(message.find("at most 2 147 483 647"), std::string::npos) << message;
    EXPECT_NE(message.find("--level 10 (1024 voxels per edge) fits"), std::string::npos) << message;
  }
}

// The readers of .vtu and .inp files limit the number of voxels. In addition, the memory must hold
// two layers of the grid. A message names the level that fits the format.
TEST_F(ExportLimits, MeshesNameTheLevelThatFits) {
  const auto file = full_grid(11);
  const std::string vtu = refusal(*file, "vtu", "a.vtu", ErrorCode::kLimit, kMemory);
  EXPECT_NE(vtu.find("8 589 934 592 voxels are selected, but readers of .vtu take at most "
                     "2 147 483 647. --level 10 (1024 voxels per edge) fits"),
            std::string::npos)
      << vtu;
  const std::string inp = refusal(*file, "inp", "a.inp", ErrorCode::kLimit, kMemory);
  EXPECT_NE(inp.find("Abaqus has labels for at most 999 999 999. --level 9 (512 voxels per edge)"),
            std::string::npos)
      << inp;
  const std::string memory =
      refusal(*full_grid(8), "vtu", "a.vtu", ErrorCode::kOutOfMemory, 100'000);
  EXPECT_NE(memory.find("a smaller --region or a coarser --level needs less"), std::string::npos)
      << memory;
}

// The search for a level that fits takes seconds, even in a full grid of 2^60 voxels, because it
// begins with the coarsest level. Counting the voxels of a level that does not fit would take
// hours.
TEST_F(ExportLimits, AreFoundAtOnce) {
  const auto file = full_grid(20);
  const double start_s = process_cpu_seconds();
  for (const char* format : {"ply", "vox"}) {
    const std::string message = refusal(*file, format, "a.x", ErrorCode::kLimit, kMemory);
    EXPECT_NE(message.find(" fits, or take a smaller --region"), std::string::npos) << message;
  }
  EXPECT_LT(process_cpu_seconds() - start_s, 4);
}

TEST_F(ExportLimits, ProgressIsReported) {
  const auto file = full_grid(6);
  const Selection part{6, {{1, 1, 1}, {62, 63, 64}}};
  for (const ExportFormat& format : export_formats()) {
    SCOPED_TRACE(format.name);
    const std::string output =
        folder_.file(std::string("a") + (format.suffix ? format.suffix : ""));
    Stages stages;
    export_dag(system_files(), *file, {&format, part, output, kMemory, false, true}, stages,
               CancelToken{});
    stages.expect_complete();
    EXPECT_TRUE(stages.stages.contains("export"));
    const bool is_counted =
        std::string_view("bt ot vdb nvdb ply npz vtu inp glb").find(format.name) !=
        std::string::npos;
    EXPECT_EQ(stages.stages.contains("count"), is_counted);
  }
}

TEST_F(ExportLimits, OctoMapHas16Levels) {
  const std::string message = refusal(*full_grid(17), "bt", "a.bt", ErrorCode::kLimit, kMemory);
  EXPECT_NE(message.find("--level 16 fits"), std::string::npos) << message;
}

// Below its top levels, HashDAG counts the voxels of a node with 24 bits. In a grid of 2^18 voxels
// per edge, the largest such nodes are cubes of 2^8 voxels per edge; if they are full, they have
// 2^24 voxels, one too many.
TEST_F(ExportLimits, HashDagCountsVoxelsWith24Bits) {
  const std::string message =
      refusal(*full_grid(18), "hashdag", "a.basic_dag.dag.bin", ErrorCode::kLimit, kMemory);
  EXPECT_NE(message.find("encloses 16 777 216 voxels"), std::string::npos) << message;
  EXPECT_NE(message.find("--level 17 (131072 voxels per edge) fits"), std::string::npos) << message;
}

// Exports to vdb and nvdb, which build the file in memory, are refused if it does not fit. The
// message names the level that fits.
TEST_F(ExportLimits, GridsInMemoryAreRefusedByTheirSize) {
  const auto file = full_grid(9, ~uint64_t{1});  // no cube is full
  for (const ExportFormat& format : export_formats()) {
    const std::string name = format.name;
    if (name == "vdb" || name == "nvdb") {
      options_.grid = GridKind::kOfFormat;
      const std::string density = refusal(*file, name, "a.x", ErrorCode::kOutOfMemory, 20 << 20);
      EXPECT_NE(density.find(". --grid mask takes less. --level 8 (256 voxels per edge) fits"),
                std::string::npos)
          << density;
      options_.grid = GridKind::kMask;
      const std::string message = refusal(*file, name, "a.x", ErrorCode::kOutOfMemory, 20 << 20);
      EXPECT_NE(message.find("would take over 20.00 MiB of memory"), std::string::npos) << message;
      EXPECT_NE(message.find("--level 8 (256 voxels per edge) fits"), std::string::npos) << message;
    }
  }
  options_.grid = GridKind::kOfFormat;
  const std::string message =
      refusal(*file, "glb", "a.glb", ErrorCode::kOutOfMemory, uint64_t{20} << 20);
  EXPECT_NE(message.find("a smaller --region or a coarser --level"), std::string::npos) << message;
}

// A chunk of a MagicaVoxel file has at most 2 GiB. A larger export is refused.
TEST_F(ExportLimits, VoxNamesTheLevelThatFits) {
  const auto file = full_grid(17);
  const std::string message = refusal(*file, "vox", "a.vox", ErrorCode::kLimit, kMemory);
  EXPECT_NE(message.find("or more are needed, but the chunks of a .vox file have at most 2.00 GiB"),
            std::string::npos)
      << message;
  EXPECT_NE(message.find("--level 9 (512 voxels per edge) fits"), std::string::npos) << message;
}

TEST_F(ExportLimits, MemoryThatDoesNotFitIsRefused) {
  const auto file = full_grid(10);
  const Selection part{10, {{1, 2, 3}, {1000, 900, 800}}};
  const std::string message =
      refusal(*file, part, "svdag", "a.svdag", ErrorCode::kOutOfMemory, 1000);
  EXPECT_NE(message.find("--region"), std::string::npos) << message;
}

TEST_F(ExportLimits, FilesOfTwoNamesNeedTheSuffixThatViewersLookFor) {
  EXPECT_THROW(export_paths(export_format("voxel"), "scene.json"), Error);
  EXPECT_EQ(export_paths(export_format("voxel"), "scene.voxel.json"),
            (std::vector<std::string>{"scene.voxel.json", "scene.voxel.bin"}));
  EXPECT_THROW(export_format("stl"), Error);
}

// An export that is canceled leaves no files.
TEST_F(ExportLimits, NothingIsLeftAfterACancellation) {
  const auto file = full_grid(9);
  CancelToken cancel;
  cancel.cancel();
  NoProgress progress;
  const ExportRequest request{
      &export_format("ply"), {9, whole_grid(9)}, folder_.file("a.ply"), kMemory};
  EXPECT_THROW(export_dag(system_files(), *file, request, progress, cancel), Error);
  EXPECT_EQ(system_files().list(folder_.path()).size(), 1u);
}

}  // namespace
