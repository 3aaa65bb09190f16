// The files of version 1 in tests/golden must remain readable, and the writer must still make the
// same bytes.
#include <gmock/gmock.h>

#include "core/format/global/open_global.h"
#include "core/format/verify/verify.h"
#include "tests/unit/core/format/golden_files.h"

namespace voxdag {
namespace {

const std::string kGolden = std::string(VOXDAG_SOURCE_DIR) + "/tests/golden";
const std::string kScene = kGolden + "/floor_and_pillar.vdag";

void verify_file(const std::string& path) {
  MemoryBudget budget(uint64_t{1} << 20);
  NoProgress progress;
  const CancelToken cancel;
  verify_global_file(*open_global_file(path), 2, budget, progress, cancel);
}

TEST(GoldenTest, WriterMakesTheSameBytes) {
  TemporaryFolder folder;
  const GlobalFileSummary summary =
      write_global(folder.file("new.vdag"), floor_and_pillar(), floor_and_pillar_grid());
  EXPECT_EQ(read_bytes(folder.file("new.vdag")), read_bytes(kScene));
  EXPECT_EQ(summary.sha256, "c9259ee6728c2dad0ece486fe9f8f24ae622be3c83cde179813935c8424dd84a");
}

TEST(GoldenTest, SceneIsRead) {
  verify_file(kScene);
  const auto file = open_global_file(kScene);
  EXPECT_EQ(file->voxels(), 71u);
  EXPECT_EQ(file->svo_nodes(), 6u);
  EXPECT_EQ(file->dag_nodes(), 4u);
  for (int64_t x = 0; x < 8; ++x)
    for (int64_t y = 0; y < 8; ++y)
      for (int64_t z = 0; z < 8; ++z)
        EXPECT_EQ(file->voxel(x, y, z), y == 0 || (x == 0 && z == 0)) << x << y << z;
}

// Each variant has one wrong byte. The error names the part of the file that contains it.
TEST(GoldenTest, CorruptVariantsAreNamed) {
  struct Variant {
    const char* what;
    size_t byte;
    unsigned char value;
    ErrorCode code;
    const char* message;
  };
  const Variant variants[] = {
      {"magic", 1, 'v', ErrorCode::kCorrupt, "not a voxdag file"},
      {"version", 8, 3, ErrorCode::kUnsupportedVersion, "format version 3, expected 1 or 2"},
      {"levels", 16, 4, ErrorCode::kCorrupt, "header: fails its checksum"},
      {"reserved", 3000, 1, ErrorCode::kCorrupt, "header: fails its checksum"},
      {"brick", 4096, 1, ErrorCode::kCorrupt, "bytes 4096 to 12287: the block fails its checksum"},
      {"padding", 8191, 1, ErrorCode::kCorrupt, "bytes 4096 to 12287: the block fails"},
      {"root", 8192, 0x36, ErrorCode::kCorrupt, "bytes 4096 to 12287: the block fails"},
      {"table", 12288, 0, ErrorCode::kCorrupt, "the checksum table fails its own checksum"},
  };
  TemporaryFolder folder;
  const std::string path = folder.file("damaged.vdag");
  for (const Variant& variant : variants) {
    SCOPED_TRACE(variant.what);
    ByteString bytes = read_bytes(kScene);
    bytes[variant.byte] = static_cast<char>(variant.value);
    write_bytes(path, bytes);
    const Error error = error_of([&] { verify_file(path); });
    EXPECT_EQ(error.code(), variant.code);
    EXPECT_THAT(error.message(), testing::HasSubstr(variant.message));
  }
  write_bytes(path, read_bytes(kScene).substr(0, 12000));
  EXPECT_THAT(error_of([&] { verify_file(path); }).message(),
              testing::HasSubstr("the file has 12000 bytes, expected 12296"));
}

// A segment that an earlier voxdag wrote, with its version of zstd, remains readable.
TEST(GoldenTest, SegmentIsRead) {
  ArtifactRef ref;
  ref.offset = 32;
  ref.bytes = 10995;
  ref.index_offset = 10771;
  ref.checksum = 0x7e162fdf8fe41b92;
  const ArtifactReader reader(system_files().open_read(segment_path(kGolden, 0)), ref);
  EXPECT_EQ(read_artifact(reader), random_rows(1, 300, 10, 2, 64));
  ASSERT_EQ(reader.roots().size(), 1u);
  EXPECT_EQ(reader.roots()[0].cube, (Cube{6, {1, 2, 3}}));
  EXPECT_EQ(reader.roots()[0].index, 7u);
}

}  // namespace
}  // namespace voxdag
