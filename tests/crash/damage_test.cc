// The disk returns wrong bytes. The build detects them, and repairs the data or refuses it. It
// never writes a wrong DAG.
#include <fstream>

#include "core/base/error.h"
#include "scheduler/state/job_store.h"
#include "tests/crash/crash_fixture.h"
#include "tests/support/flip_bits.h"

namespace crash {
namespace {

using voxdag::Error;
using voxdag::ErrorCode;

class DamageTest : public CrashTest {
 protected:
  // Builds until the process is killed at this disk operation. Returns false if the build ended
  // before the operation.
  bool killed_at(uint64_t operation) const { return killed({Fault::kKillBefore, operation}); }

  // Flips one bit of the file, which must not be empty.
  static void flip(const std::string& path, std::mt19937_64& random) {
    const uint64_t bit = random() % (8 * std::filesystem::file_size(path));
    SCOPED_TRACE(testing::Message() << path << ", bit " << bit);
    voxdag::flip_bits(path, bit / 8, 1 << bit % 8);
  }

  // Runs the build with the files that are on the disk. The build must give the correct bytes, or
  // refuse the files and give the correct bytes with --restart. Returns true if it did not refuse.
  bool expect_healed_or_refused(voxdag::FileSystem& files = voxdag::system_files()) {
    bool healed = true;
    try {
      EXPECT_EQ(build(spec(), files).sha256, expected_);
    } catch (const Error& error) {
      healed = false;
      EXPECT_TRUE(error.code() == ErrorCode::kCorrupt || error.code() == ErrorCode::kInvalidInput ||
                  error.code() == ErrorCode::kUnsupportedVersion || error.code() == ErrorCode::kIo)
          << error.what();
      BuildSpec again = spec();
      again.run.restart = true;
      EXPECT_EQ(build(again, voxdag::system_files()).sha256, expected_) << error.what();
    }
    EXPECT_FALSE(std::filesystem::exists(output() + ".work"));
    std::filesystem::remove(output());
    return healed;
  }
};

// During a build, one bit of a write to any file is flipped.
TEST_P(DamageTest, BitsFlippedInAnyWrite) {
  const uint64_t operations = operations_of_a_build();
  for (const uint64_t at : moments(operations)) {
    SCOPED_TRACE(testing::Message() << "operation " << at << " of " << operations);
    FaultyFiles files({Fault::kFlipBit, at});
    EXPECT_TRUE(expect_healed_or_refused(files));
  }
}

// While the build is stopped, one bit flips in one of its files: a segment, the job store or its
// log, a position map, an artifact of a merge pass, or the partial global file.
TEST_P(DamageTest, BitsFlippedBetweenTwoRuns) {
  const uint64_t operations = operations_of_a_build();
  std::mt19937_64 random(2);
  uint64_t flips = 0;
  for (uint64_t round = 0; round < rounds() / 3; ++round) {
    const uint64_t at = 1 + random() % operations;
    std::vector<std::string> names = {"out.vdag.partial"};
    for (uint64_t i = 0; i < names.size(); ++i) {
      if (!killed_at(at) || !std::filesystem::exists(output() + ".work")) break;
      if (i == 0)
        for (const auto& file : std::filesystem::recursive_directory_iterator(output() + ".work"))
          if (file.is_regular_file())
            names.push_back(std::filesystem::relative(file.path(), folder_.path()));
      const std::string path = folder_.file(names[i]);
      SCOPED_TRACE(testing::Message()
                   << names[i] << ", killed at operation " << at << " of " << operations);
      std::error_code missing;
      if (std::filesystem::file_size(path, missing) > 0 && !missing) {
        flip(path, random);
        ++flips;
      }
      expect_healed_or_refused();
    }
  }
  EXPECT_GT(flips, 0u);
}

// The first page of the partial file shows that voxdag created the file. If this page is damaged,
// the file is still accepted, because its job is stored next to it.
TEST_P(DamageTest, FirstPageOfThePartialFile) {
  const std::string partial = output() + ".partial";
  uint64_t at = operations_of_a_build();
  std::error_code missing;
  while (--at > 0)
    if (killed_at(at) && std::filesystem::file_size(partial, missing) > 4096 && !missing) break;
  ASSERT_GT(at, 0u);
  std::fstream(partial, std::ios::in | std::ios::out | std::ios::binary) << "damaged";
  EXPECT_TRUE(expect_healed_or_refused());
}

// One bit flips in the job store while the build is stopped, as in BitsFlippedBetweenTwoRuns. This
// is tested many times, because SQLite does not store checksums of its pages.
TEST_P(DamageTest, BitsFlippedInTheJobStore) {
  const uint64_t operations = operations_of_a_build();
  std::mt19937_64 random(3);
  for (uint64_t round = 0; round < rounds(); ++round) {
    if (!killed_at(operations / 4 + random() % (operations / 2))) continue;
    const std::string store = output() + ".work/job.db";
    {
      // Opening and closing the store moves the contents of the log into the store.
      voxdag::JobStore closed(store, voxdag::JobStore::Access::kBuild);
    }
    SCOPED_TRACE(round);
    flip(store, random);
    expect_healed_or_refused();
  }
}

// Triangles that do not fit in memory are spilled. Some of their bytes change before the build
// reads them back, so the build reads the scene again.
TEST_P(DamageTest, BitsFlippedInSpilledTriangles) {
  voxdag::GenerateOptions options;
  options.kind = voxdag::SceneKind::kSoup;
  options.triangles = 700000;
  voxdag::NoProgress progress;
  voxdag::CancelToken cancel;
  voxdag::generate_scene(voxdag::system_files(), folder_.file("scene.glb"), options, progress,
                         cancel);
  BuildSpec many = spec();
  many.geometry.resolution = 64;
  many.run.subvolume_edge = 64;
  many.run.checkpoint_interval_s = 1;
  FaultyFiles counting({});
  const BuildReport whole = build(many, counting);
  EXPECT_GT(whole.spill_bytes, 0u);
  std::filesystem::remove(output());
  uint64_t healed = 0;
  for (const uint64_t at : {counting.operations() / 4, counting.operations() / 3}) {
    SCOPED_TRACE(at);
    FaultyFiles files({Fault::kFlipBit, at});
    Warnings warnings;
    voxdag::CancelToken never;
    EXPECT_EQ(voxdag::run_build(many, {files, warnings, never}).sha256, whole.sha256);
    healed += warnings.last.find("triangles.vd") != std::string::npos;
    std::filesystem::remove(output());
  }
  EXPECT_GT(healed, 0u);
}

INSTANTIATE_TEST_SUITE_P(Ingested, DamageTest,
                         testing::Values(Ingested::kInMemory, Ingested::kDurable), name_of);

}  // namespace
}  // namespace crash
