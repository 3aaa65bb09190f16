// An export of a damaged file gives an Error or a file. It never crashes, and leaves no temporary
// files.
#include <gtest/gtest.h>

#include <fstream>
#include <random>

#include "core/base/error.h"
#include "core/format/global/open_global.h"
#include "query/export/export.h"
#include "query/export/export_job.h"
#include "tests/support/audience_guard.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/core/format/color/colored_files.h"
#include "tests/unit/query/export/corners.h"

namespace voxdag::query {
namespace {

constexpr uint32_t kDamagedLevels = 10;
constexpr uint64_t kDamageMemory = 64 << 20;

class ExportDamage : public testing::TestWithParam<const char*> {
 protected:
  // Exports the file. Returns true if the export reports damage.
  bool is_refused(const std::string& path) {
    const auto file = open_global_file(path);
    const std::string format = GetParam();
    const ExportFormat& to = export_format(format);
    const std::string output = folder_.file(std::string("out") + (to.suffix ? to.suffix : ".x"));
    NoProgress progress;
    bool refused = false;
    try {
      export_dag(system_files(), *file,
                 {&to, {kDamagedLevels, {{0, 0, 0}, {1024, 1024, 1024}}}, output, kDamageMemory},
                 progress, CancelToken{});
      for (const std::string& written : export_paths(to, output)) system_files().remove(written);
    } catch (const Error& error) {
      refused = true;
      EXPECT_EQ(error.code(), ErrorCode::kCorrupt) << error.message();
      EXPECT_TRUE(error.message().starts_with(path + ": ")) << error.message();
      EXPECT_EQ(error.message().find(path, 1), std::string::npos) << error.message();
    }
    EXPECT_EQ(system_files().list(folder_.path()).size(), 1u) << "only the input is there";
    return refused;
  }
  TemporaryFolder folder_;
};

// A file with damaged words whose checksums are correct is refused or exported. Without correct
// checksums, it is always refused.
TEST_P(ExportDamage, IsAnErrorOrHarmless) {
  const std::string path = folder_.file("a.vdag");
  write_corners(path, kDamagedLevels);
  EXPECT_FALSE(is_refused(path));
  std::ifstream input(path, std::ios::binary);
  const std::string intact((std::istreambuf_iterator<char>(input)), {});
  constexpr size_t kPage = 4096;
  std::mt19937 random(7);
  const uint32_t values[] = {0, 1, 2, 3, 255, 256, 0x7fffffff, 0xfffffff0, 0xffffffff};
  int refused = 0;
  for (int round = 0; round < 60; ++round) {
    std::string damaged = intact;
    // Damages one of the first words of a page, because each level begins at a page boundary and
    // has only a few words.
    const size_t pages = (intact.size() - kPage) / kPage;
    const size_t at = kPage * (1 + random() % std::max<size_t>(pages, 1)) + 4 * (random() % 8);
    if (at + 4 > damaged.size()) continue;
    const uint32_t value =
        round % 3 ? values[random() % std::size(values)] : static_cast<uint32_t>(random());
    std::memcpy(damaged.data() + at, &value, sizeof value);
    SCOPED_TRACE(testing::Message() << "word at byte " << at << " is " << value);
    write_bytes(path, damaged);
    EXPECT_EQ(is_refused(path), damaged != intact);
    put_checksums_right(damaged);
    write_bytes(path, damaged);
    refused += is_refused(path);
  }
  EXPECT_GT(refused, 5);
}

TEST(DamageTextTest, NamesTheCommandOfEachAudience) {
  EXPECT_EQ(damage_text(), "the file is damaged (voxdag verify reports where)");
  {
    const test::AudienceGuard python(kPythonUsers);
    EXPECT_EQ(damage_text(), "the file is damaged (the shell command voxdag verify reports where)");
  }
  const test::AudienceGuard others(test::kOtherUsers);
  EXPECT_EQ(damage_text(), "the file is damaged");
}

INSTANTIATE_TEST_SUITE_P(Formats, ExportDamage,
                         testing::Values("hashdag", "svdag", "voxel", "vox", "bt", "ot", "npz",
                                         "ply"),
                         [](const auto& format) { return std::string(format.param); });

}  // namespace
}  // namespace voxdag::query
