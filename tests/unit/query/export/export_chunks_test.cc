// Tests exports in chunks: each set cell of each level must be in exactly one chunk, and the
// manifest must describe the files.
#include "query/export/chunks/export_chunks.h"

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "core/base/error.h"
#include "core/format/checksum.h"
#include "core/format/global/open_global.h"
#include "tests/support/error_of.h"
#include "tests/unit/query/query_files.h"

namespace voxdag::query {
namespace {

class ExportChunks : public testing::Test {
 protected:
  ExportChunks()
      : voxels_(64), scene_(scattered(voxels_)), file_(open_global_file(scene_.path())) {}

  // Sets voxels in three of the eight octants of the grid.
  static const oracle::Voxels& scattered(oracle::Voxels& voxels) {
    for (int i = 0; i < 20; ++i) voxels.set(i, (7 * i) % 30, (3 * i) % 32);
    for (int i = 32; i < 64; ++i) voxels.set(i, 31, 40);
    voxels.set(63, 63, 63);
    return voxels;
  }
  ChunksReport exported(uint64_t edge, uint64_t levels, const Region& region = whole_grid(6)) {
    ChunksRequest request{{&export_format("npz"), {6, region}, folder(), 64 << 20}, edge, levels};
    request.request.options.compact = true;
    request.request.replace = replace_;
    return export_chunks(system_files(), *file_, request, progress_, cancel_);
  }
  nlohmann::json manifest() const {
    return nlohmann::json::parse(read_bytes(folder() + "/manifest.json"));
  }
  std::string folder() const { return folder_.file("chunks"); }
  // Returns the `count` cells of an exported .npz file, which are the file's first array.
  QueryFile::Cells cells_in(const std::string& path, uint64_t count) const {
    const std::string bytes = read_bytes(folder() + "/" + path);
    size_t at = bytes.find('\n') + 1;  // after the header of the array
    QueryFile::Cells cells;
    for (; count > 0; --count, at += 12) {
      std::array<int32_t, 3> cell{};
      std::memcpy(cell.data(), &bytes[at], 12);
      cells.insert({cell[0], cell[1], cell[2]});
    }
    return cells;
  }

  oracle::Voxels voxels_;
  const QueryFile scene_;
  const std::unique_ptr<voxdag_reader::File> file_;
  // Cancels the export when its first chunk is complete, if `is_impatient` is set.
  struct ChunkProgress : NoProgress {
    void begin_stage(std::string_view name, uint64_t, std::string_view) override {
      is_export = name == "export";
    }
    void advance(uint64_t) override {
      if (is_export && is_impatient) cancel->cancel();
    }
    CancelToken* cancel = nullptr;
    bool is_export = false, is_impatient = false;
  };

  TemporaryFolder folder_;
  CancelToken cancel_;
  ChunkProgress progress_;
  bool replace_ = false;
};

TEST_F(ExportChunks, EachCellIsInOneChunk) {
  const ChunksReport report = exported(16, 3);
  const nlohmann::json list = manifest();
  EXPECT_EQ(list["format"], "npz");
  EXPECT_EQ(list["chunk_voxels"], 16);
  ASSERT_EQ(list["levels"].size(), 3u);
  uint64_t chunks = 0, bytes = 0;
  for (const auto& level : list["levels"]) {
    QueryFile::Cells all;
    for (const auto& chunk : level["chunks"]) {
      ++chunks;
      const auto& file = chunk["files"][0];
      const auto cells = cells_in(file["path"], chunk["voxels"]);
      for (const Position& cell : cells) {
        EXPECT_TRUE(all.insert(cell).second);
        for (size_t axis = 0; axis < 3; ++axis) {
          EXPECT_EQ(cell[axis] / 16, chunk["place"][axis]);
          EXPECT_GE(cell[axis], chunk["low"][axis]);
          EXPECT_LT(cell[axis], chunk["high"][axis]);
        }
      }
      const std::string text = read_bytes(folder() + "/" + file["path"].get<std::string>());
      EXPECT_EQ(file["sha256"], sha256_hex(text));
      EXPECT_EQ(file["bytes"], text.size());
      bytes += text.size();
    }
    EXPECT_EQ(all, scene_.cells(level["level"]));
  }
  EXPECT_EQ(report.chunks, chunks);
  EXPECT_EQ(report.bytes, bytes);
  EXPECT_LT(chunks, 64u);  // chunks without voxels have no files
}

TEST_F(ExportChunks, ARegionCutsChunks) {
  const Region region{{3, 0, 5}, {40, 64, 41}};
  const ChunksReport report = exported(32, 1, region);
  uint64_t expected = 0;
  for (const Position& cell : scene_.cells(6)) expected += region.contains(cell, 1);
  EXPECT_EQ(report.voxels, expected);
  EXPECT_EQ(manifest()["levels"][0]["chunks"][0]["low"], (Position{3, 0, 5}));
}

TEST_F(ExportChunks, AFolderWithFilesIsRefused) {
  exported(64, 1);
  EXPECT_THROW(exported(32, 1), Error);
  replace_ = true;
  EXPECT_NO_THROW(exported(32, 1));
  for (const auto& [edge, levels] : {std::pair{48, 1}, std::pair{2, 1}, std::pair{16, 6}})
    EXPECT_THROW(exported(static_cast<uint64_t>(edge), static_cast<uint64_t>(levels)), Error);
}

// A canceled export removes the folders that it has created, and no others.
TEST_F(ExportChunks, ACanceledExportLeavesNoFolders) {
  progress_.cancel = &cancel_;
  progress_.is_impatient = true;
  EXPECT_THROW(exported(16, 2), Error);
  EXPECT_FALSE(std::filesystem::exists(folder()));
  std::filesystem::create_directories(folder());
  EXPECT_THROW(exported(16, 2), Error);
  EXPECT_TRUE(std::filesystem::is_empty(folder()));
  // A file of another program keeps its folder, and does not hide the error.
  write_bytes(folder() + "/notes", "a");
  replace_ = true;
  EXPECT_EQ(error_of([&] { exported(16, 2); }).code(), ErrorCode::kCanceled);
  EXPECT_TRUE(std::filesystem::exists(folder() + "/notes"));
}

// An export of a region without voxels succeeds, and writes no chunks.
TEST_F(ExportChunks, AnEmptyRegionHasAnEmptyManifest) {
  EXPECT_EQ(exported(16, 1, {{32, 0, 0}, {48, 16, 16}}).chunks, 0u);
  EXPECT_EQ(manifest()["levels"][0]["chunks"].size(), 0u);
}

}  // namespace
}  // namespace voxdag::query
