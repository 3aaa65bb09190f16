// Tests limits of formats that only files of many gigabytes reach. The header of the input has the
// large counts, and its levels are a hole in the file; some tests lower a limit instead. An export
// whose count equals the limit is accepted. If the count exceeds the limit by one, the export is
// refused, the message names a level that fits, and no files remain.
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>

#include "core/format/checksum.h"
#include "core/format/global/global_layout.h"
#include "core/format/global/open_global.h"
#include "query/export/export_job.h"
#include "tests/unit/core/format/test_files.h"
#include "tests/unit/query/export/corners.h"

namespace voxdag::query {
namespace {

using namespace global_layout;

// Writes a file with these levels, beginning with the root's level. The words of the levels are
// zeros in a hole of the file, which takes no disk space.
void write_hole(const std::string& path, const std::vector<GlobalLevel>& levels) {
  ByteString page(kPageBytes, '\0');
  const auto put = [&](size_t at, auto value) { std::memcpy(&page[at], &value, sizeof(value)); };
  put(kMagicAt, kMagic);
  put(kVersionAt, kVersion);
  put(kHeaderBytesAt, static_cast<uint32_t>(kPageBytes));
  put(kGridLevelsAt, static_cast<uint32_t>(levels.size() + 1));
  put(kHashBitsAt, uint32_t{64});
  put(kNodeOrderAt, static_cast<uint32_t>(NodeOrder::kByHash));
  put(kChecksumBlockBytesAt, static_cast<uint32_t>(kChecksumBlockBytes));
  put(kEdgeAt, 1.0);
  put(kVoxelsAt, uint64_t{1000});
  uint64_t end = kPageBytes, nodes = 0;
  for (size_t level = levels.size(); level-- > 0;) {
    const size_t entry = kLevelsAt + level * kLevelEntryBytes;
    put(entry, end);
    put(entry + 8, levels[level].nodes);
    put(entry + 16, levels[level].words);
    nodes += levels[level].nodes;
    end = round_up_to_page(end + 4 * levels[level].words);
  }
  put(kDagNodesAt, nodes);
  const uint64_t blocks = (end - kPageBytes + kChecksumBlockBytes - 1) / kChecksumBlockBytes;
  const std::vector<std::byte> table(8 * blocks);
  put(kFileBytesAt, end + table.size());
  put(kTableOffsetAt, end);
  put(kTableCountAt, blocks);
  put(kTableChecksumAt, checksum64(table));
  put(kHeaderChecksumAt, checksum64(std::as_bytes(std::span(page)).first(kHeaderChecksumAt)));
  write_bytes(path, page);
  std::filesystem::resize_file(path, end + table.size());
}

class ExportHuge : public testing::Test {
 protected:
  // Exports a complete file with these levels, and returns the error. The levels have no valid
  // nodes, so every such export fails.
  Error error(const std::vector<GlobalLevel>& levels, const ExportFormat& format) {
    write_hole(folder_.file("a.vdag"), levels);
    return error_of([&] { run(format, static_cast<uint32_t>(levels.size() + 1)); });
  }
  ExportReport run(const ExportFormat& format, uint32_t grid_levels) {
    const auto file = open_global_file(folder_.file("a.vdag"));
    const std::string output =
        folder_.file(std::string("out") + (format.suffix ? format.suffix : ".x"));
    const ExportRequest request{&format, {grid_levels, whole_grid(grid_levels)}, output, kMemory};
    NoProgress progress;
    return export_dag(system_files(), *file, request, progress, CancelToken{});
  }

  // Expects that the limit of the format refuses the export. `problem` is the message after the
  // name of the output, and `fitting` begins with the level that fits.
  void expect_refused(const std::vector<GlobalLevel>& levels, const std::string& format,
                      const std::string& problem, const std::string& fitting) {
    const Error refused = error(levels, export_format(format));
    EXPECT_EQ(refused.code(), ErrorCode::kLimit);
    EXPECT_TRUE(refused.message().ends_with(": " + problem + ". --level " + fitting +
                                            " voxels per edge) fits, or take a smaller --region"))
        << refused.message();
    EXPECT_EQ(system_files().list(folder_.path()).size(), 1u) << "only the input is there";
  }
  // Expects that the limit does not refuse the export. It then fails for another reason, because
  // all words are zero, or because disk space or memory is insufficient.
  void expect_not_refused(const std::vector<GlobalLevel>& levels, const std::string& format) {
    const Error error = this->error(levels, export_format(format));
    EXPECT_NE(error.code(), ErrorCode::kLimit) << error.message();
    EXPECT_EQ(system_files().list(folder_.path()).size(), 1u) << "only the input is there";
  }

  // Returns levels for a grid of 2^grid_levels voxels per edge. Each level has one node with one
  // child.
  static std::vector<GlobalLevel> chain(uint32_t grid_levels) {
    return std::vector<GlobalLevel>(grid_levels - 1, {1, 2});
  }

  static constexpr uint64_t kMemory = 64 << 20;
  TemporaryFolder folder_;
};

constexpr uint64_t k24Bits = uint64_t{1} << 24, k32Bits = uint64_t{1} << 32;

// A PlayCanvas file has a word for the root and one word for each child pointer.
TEST_F(ExportHuge, PlayCanvasVoxelsCountWordsWith24Bits) {
  std::vector<GlobalLevel> levels = chain(8);
  const uint64_t others = 1 + 5;  // the root's word, and the pointers of the other levels
  levels[4] = {2'000'000, 2'000'000 + k24Bits - others};
  expect_not_refused(levels, "voxel");
  ++levels[4].words;
  expect_refused(levels, "voxel",
                 "16 777 217 node words and 1 leaves are needed, but the indices of PlayCanvas "
                 "voxels reach 16 777 216",
                 "7 (128");
}

TEST_F(ExportHuge, PlayCanvasVoxelsCountLeavesWith24Bits) {
  std::vector<GlobalLevel> levels = chain(8);
  levels[6] = {k24Bits, 2 * k24Bits};
  expect_not_refused(levels, "voxel");
  levels[6] = {k24Bits + 1, 2 * k24Bits + 2};
  expect_refused(levels, "voxel",
                 "7 node words and 16 777 217 leaves are needed, but the indices of PlayCanvas "
                 "voxels reach 16 777 216",
                 "7 (128");
}

// Returns `levels` with a total of `words` words in three of the levels, so that no single level
// exceeds the limit of the format.
std::vector<GlobalLevel> many_words(std::vector<GlobalLevel> levels, uint64_t words) {
  for (const size_t level : {4, 5, 6}) levels[level] = {k32Bits / 64, words / 3};
  levels[4].words += words - words / 3 * 3;
  return levels;
}

TEST_F(ExportHuge, HashDagCountsWordsWith32Bits) {
  const uint64_t others = 2 * 6;
  expect_not_refused(many_words(chain(10), k32Bits - others), "hashdag");
  expect_refused(many_words(chain(10), k32Bits - others + 1), "hashdag",
                 "4 294 967 297 words (16.00 GiB) are needed, but the indices of HashDAG reach "
                 "4 294 967 296",
                 "9 (512");
}

// HashDAG's top levels must have fewer than 2^24 nodes in total, because each of these nodes stores
// a 24-bit index where other nodes store a count of voxels.
TEST_F(ExportHuge, HashDagCountsTopNodesWith24Bits) {
  std::vector<GlobalLevel> levels = chain(17);
  const uint64_t others = 9;
  levels[9] = {k24Bits - 1 - others, 2 * k24Bits};
  expect_not_refused(levels, "hashdag");
  ++levels[9].nodes;
  expect_refused(levels, "hashdag",
                 "the top 10 levels have 16 777 216 nodes, but HashDAG takes fewer than 16 777 216",
                 "16 (65536");
}

// In an SVDAG file, a brick has one word, and one more word for each octant with voxels. Here all
// octants of the bricks are empty.
TEST_F(ExportHuge, SvdagCountsWordsWith32Bits) {
  const uint64_t others = 2 * 5 + 1 + 255;
  expect_not_refused(many_words(chain(10), k32Bits - 1 - others), "svdag");
  expect_refused(many_words(chain(10), k32Bits - others), "svdag",
                 "4 294 967 296 words (16.00 GiB) are needed, but an SVDAG file has at most "
                 "4 294 967 295",
                 "8 (256");
}

// The numbers of triangles and vertices decide the size of a .glb file. A checkerboard has the most
// triangles: every voxel has six faces, and no two faces can be merged. Its vertices are all
// corners of cells, except four corners of the grid.
TEST_F(ExportHuge, GlbCountsBytesWith32Bits) {
  constexpr uint32_t kLevels = 6;
  GlobalFileWriter writer(system_files(), folder_.file("a.vdag"),
                          Grid::given({0, 0, 0}, 1, kLevels), 64);
  write_level(writer, kLevels - 2, 1, {0x69696969, 0x69696969});
  uint64_t svo_nodes = uint64_t{1} << 3 * (kLevels - 2);
  for (uint32_t level = kLevels - 2; level-- > 0;) {
    write_level(writer, level, 1, {0xff, 0, 0, 0, 0, 0, 0, 0, 0});
    svo_nodes += uint64_t{1} << 3 * level;
  }
  constexpr uint64_t kVoxels = uint64_t{1} << (3 * kLevels - 1), kCorners = 65 * 65 * 65 - 4;
  constexpr uint64_t kMeshBytes = 6 * kVoxels * 24 + kCorners * 8;
  writer.finish({kVoxels, svo_nodes});

  // The file has exactly one byte more than the limit of the first export, and exactly as many
  // bytes as the limit of the last export.
  ExportFormat format = export_format("glb");
  format.write = [](const ExportJob& job) { return write_glb_within(job, 4096 + kMeshBytes - 1); };
  const Error refused = error_of([&] { run(format, kLevels); });
  EXPECT_EQ(refused.code(), ErrorCode::kLimit);
  EXPECT_TRUE(refused.message().ends_with(
      ": the mesh is too large: a .glb file has at most 20.10 MiB. --level 5 (32 voxels per edge) "
      "fits, or take a smaller --region"))
      << refused.message();
  EXPECT_EQ(system_files().list(folder_.path()).size(), 1u) << "only the input is there";
  EXPECT_EQ(run(format, kLevels - 1).notes[0], "6 rectangles, 12 triangles, 8 vertices");
  system_files().remove(folder_.file("out.x"));

  format.write = [](const ExportJob& job) { return write_glb_within(job, 4096 + kMeshBytes); };
  EXPECT_EQ(run(format, kLevels).notes[0],
            "786 432 rectangles, 1 572 864 triangles, 274 621 vertices");
}

}  // namespace
}  // namespace voxdag::query
