// At any disk operation, a build is killed or loses power, or its disk becomes full or fails. The
// next build resumes and gives the same bytes.
//
// By default, the tests choose a few operations at random. VOXDAG_CRASH_ROUNDS=N sets the number of
// moments that are tested per fault. For a large N, the tests use every operation and N random
// times.
#include "core/base/clock.h"
#include "tests/crash/crash_fixture.h"

namespace crash {
namespace {

TEST_P(CrashTest, KilledAtAnyOperation) { kill_at_any_operation(); }

// The same scene at a higher resolution and with larger subvolumes. The build takes about as long
// as the build of CrashTest, but spends more of this time on computations.
class FineCrashTest : public CrashTest {
 protected:
  BuildSpec spec() const override {
    BuildSpec spec = CrashTest::spec();
    spec.geometry.resolution = 2048;
    spec.run.subvolume_edge = 512;
    // If the triangles are durable, the build writes checkpoints even during its passes over the
    // triangles.
    if (is_durable()) spec.run.checkpoint_interval_s = 1e-4;
    return spec;
  }
};

// Kills the build with SIGKILL at random times, for example in SQLite or during computations.
TEST_P(FineCrashTest, KilledAtRandomMoments) {
  const double start = voxdag::wall_seconds();
  run(voxdag::system_files());
  const auto whole_us = static_cast<uint64_t>(1e6 * (voxdag::wall_seconds() - start));
  std::filesystem::remove(output());
  std::mt19937_64 random(1);
  for (uint64_t i = 0; i < rounds(); ++i) {
    const auto after = std::chrono::microseconds(1000 + random() % whole_us);
    SCOPED_TRACE(testing::Message() << "after " << after.count() << " us of " << whole_us);
    killed({}, after);
    // The build is killed again after it has resumed.
    killed({}, after / 2);
    expect_to_resume();
  }
}

// A build whose first checkpoint is never due: its job store has no file, so the next run starts
// from the beginning.
class ShortCrashTest : public CrashTest {
 protected:
  BuildSpec spec() const override {
    BuildSpec spec = CrashTest::spec();
    spec.run.checkpoint_interval_s = 1e9;
    return spec;
  }
};

TEST_P(ShortCrashTest, KilledAtAnyOperation) { kill_at_any_operation(); }

TEST_P(CrashTest, DiskFullOrBroken) { break_disk_at_any_operation(); }

// If the disk becomes full while subvolumes are built, no stored subvolume is lost.
TEST_P(CrashTest, AFullDiskLosesNothingThatItStored) {
  if (is_durable()) GTEST_SKIP() << "counts the operations of a build without durable triangles";
  voxdag::GenerateOptions options;
  options.kind = voxdag::SceneKind::kSoup;
  options.triangles = 20000;
  voxdag::NoProgress progress;
  voxdag::CancelToken cancel;
  voxdag::generate_scene(voxdag::system_files(), folder_.file("scene.glb"), options, progress,
                         cancel);
  BuildSpec one = spec();
  one.geometry.resolution = 2048;
  one.run.threads = 1;
  FaultyFiles counting({});
  const BuildReport whole = build(one, counting);
  ASSERT_GT(whole.artifact_bytes, uint64_t{4} << 20) << "fewer than four writes of a segment";
  std::filesystem::remove(output());
  // The first six operations make the work folder and create the segment file. The seventh
  // operation writes the segment's first MiB. So operation 10, which fails, writes the segment's
  // fourth MiB.
  FaultyFiles files({Fault::kNoSpace, 10});
  EXPECT_THROW(build(one, files), voxdag::Error);
  const BuildReport report = build(one, voxdag::system_files());
  EXPECT_GT(report.subvolumes_reused, 0u);
  EXPECT_EQ(report.sha256, whole.sha256);
}

// If reads fail, the build ends with an error. It does not treat an artifact that it cannot read as
// damaged, so it discards no artifact.
TEST_P(CrashTest, ReadsThatFail) {
  FaultyFiles counting({});
  run(counting);
  std::filesystem::remove(output());
  for (const uint64_t at : moments(counting.reads())) {
    SCOPED_TRACE(testing::Message() << "from read " << at << " of " << counting.reads());
    FaultyFiles files({Fault::kReadError, at});
    try {
      run(files);
      // The number of reads differs slightly between runs, because threads share the blocks that
      // they read. So this run may end before the planned read.
      EXPECT_LT(files.reads(), at) << "the build went through";
    } catch (const voxdag::Error& error) {
      EXPECT_EQ(error.code(), voxdag::ErrorCode::kIo) << error.what();
    }
    expect_to_resume();
  }
}

INSTANTIATE_TEST_SUITE_P(Ingested, CrashTest,
                         testing::Values(Ingested::kInMemory, Ingested::kDurable), name_of);
INSTANTIATE_TEST_SUITE_P(Ingested, ShortCrashTest, testing::Values(Ingested::kInMemory), name_of);
INSTANTIATE_TEST_SUITE_P(Ingested, FineCrashTest,
                         testing::Values(Ingested::kInMemory, Ingested::kDurable), name_of);

}  // namespace
}  // namespace crash
