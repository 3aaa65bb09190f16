// Scan, ingest and partition of a large scene resume after an interruption. Finished work is not
// repeated, and is never used for another scene.
#include "scheduler/state/checkpoint/ingest_checkpoint.h"

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "tests/support/temporary_folder.h"
#include "tests/unit/scheduler/interruptions.h"
#include "tests/unit/scheduler/metered_files.h"
#include "tests/unit/scheduler/spheres_build.h"

namespace voxdag {
namespace {

class LastWarning : public NoProgress {
 public:
  void warn(std::string_view message) override { text = message; }
  std::string text;
};

class IngestCheckpointTest : public testing::Test {
 protected:
  void SetUp() override {
    make_scene(1);
    BuildSpec plain = spec();
    plain.run.durable_min_triangles = UINT64_MAX;
    const BuildReport report = build(plain);
    expected_ = report.sha256;
    subvolumes_ = report.subvolumes;
    whole_ = files_.bytes_read[scene()];
    EXPECT_FALSE(files_.bytes_written.contains(durable()));
    std::filesystem::remove(output());
  }
  void make_scene(uint64_t seed) const { write_spheres(scene(), 80000, seed); }
  std::string scene() const { return folder_.file("scene.glb"); }
  std::string output() const { return folder_.file("out.vdag"); }
  std::string work() const { return output() + ".work"; }
  std::string durable() const { return work() + "/triangles.vddurable"; }

  // Returns a build that writes checkpoints only at the ends of scan, ingest and partition.
  BuildSpec spec() const {
    BuildSpec spec = spheres_build(scene(), output());
    spec.run.checkpoint_interval_s = 1e9;
    spec.run.durable_min_triangles = 1;
    return spec;
  }
  // Returns a build that also writes a checkpoint after every piece of the scene.
  BuildSpec often() const {
    BuildSpec often = spec();
    often.run.checkpoint_interval_s = 0;
    return often;
  }
  BuildReport build(const BuildSpec& spec) {
    files_.forget_counts();
    last_warning_ = {};
    CancelToken cancel;
    return run_build(spec, {files_, last_warning_, cancel});
  }
  // Builds. Expects the correct bytes, no warning, and no work folder afterwards.
  BuildReport expect_to_resume(const BuildSpec& spec) {
    const BuildReport report = build(spec);
    EXPECT_EQ(report.sha256, expected_);
    EXPECT_EQ(last_warning_.text, "");
    EXPECT_FALSE(std::filesystem::exists(work()));
    std::filesystem::remove(output());
    return report;
  }
  // Returns the fraction of the scene file that the last build read, relative to a complete build.
  double part_read() {
    return static_cast<double>(files_.bytes_read[scene()]) / static_cast<double>(whole_);
  }

  TemporaryFolder folder_;
  MeteredFiles files_;
  LastWarning last_warning_;
  std::string expected_;
  uint64_t subvolumes_ = 0;
  uint64_t whole_ = 0;
};

// A build that is interrupted at any point resumes there: it reads only the rest of the scene, or
// nothing if the scene was already ingested.
TEST_F(IngestCheckpointTest, ResumesWhereItWas) {
  struct Moment {
    const char* stage;
    uint64_t after;
    double min_read, max_read;  // limits of part_read() for the resumed build
  };
  for (const Moment& moment :
       {Moment{"scan", 40000, 0.6, 0.9}, Moment{"ingest", 10000, 0.3, 0.6},
        Moment{"ingest", 60000, 0.01, 0.3}, Moment{"build", 0, 0, 0}, Moment{"merge", 0, 0, 0}}) {
    SCOPED_TRACE(std::string(moment.stage) + " after " + std::to_string(moment.after));
    build_until(often(), moment.stage, moment.after, files_);
    expect_to_resume(often());
    EXPECT_GE(part_read(), moment.min_read);
    EXPECT_LE(part_read(), moment.max_read);
  }
}

// A build that fails in the partition, here at a failing sync, resumes at the last checkpoint of
// the partition and does not read the scene again.
TEST_F(IngestCheckpointTest, ResumesInThePartition) {
  build(often());
  std::filesystem::remove(output());
  const uint64_t syncs = files_.syncs[durable()];
  ASSERT_GT(syncs, 10u);
  for (const uint64_t at : {syncs, syncs - 1, syncs - 4}) {
    SCOPED_TRACE(testing::Message() << "sync " << at << " of " << syncs);
    files_.failing_sync[durable()] = at;
    EXPECT_THROW(build(often()), Error);
    files_.failing_sync.clear();
    const uint64_t first_run = files_.bytes_written[durable()];
    expect_to_resume(often());
    EXPECT_EQ(part_read(), 0);
    EXPECT_LT(files_.bytes_written[durable()], first_run);
  }
}

// A build can be resumed with other run options. If these options require smaller subvolumes, the
// build splits subvolumes that the earlier run has planned. It does not read the scene again.
TEST_F(IngestCheckpointTest, RunOptionsMayChange) {
  for (const char* stage : {"ingest", "build"}) {
    SCOPED_TRACE(stage);
    build_until(spec(), stage, 10);
    BuildSpec other = spec();
    other.run.subvolume_edge = 64;
    other.run.memory_bytes = uint64_t{64} << 20;
    other.run.threads = 3;
    build_until(other, "build", 15);
    const BuildReport report = expect_to_resume(other);
    EXPECT_GT(report.subvolumes_reused, 0u);
    EXPECT_GT(report.subvolumes, subvolumes_);
    EXPECT_EQ(part_read(), 0);
  }
}

// The triangles of built and recorded subvolumes are removed from the disk, and their file is
// removed before the merge.
TEST_F(IngestCheckpointTest, FreesWhatIsBuilt) {
  build_until(spec(), "build", 0);
  const uint64_t all = std::filesystem::file_size(durable());
  build_until(spec(), "build", subvolumes_ / 2, files_);
  EXPECT_GT(files_.bytes_released[durable()], all / 4);
  EXPECT_TRUE(std::filesystem::exists(durable()));
  build_until(spec(), "merge", 0);
  EXPECT_FALSE(std::filesystem::exists(durable()));
  expect_to_resume(spec());
}

// If the scene file is replaced by another scene, the build is refused, and the job is not changed.
// When the first scene is back, the job resumes, even if its file has new times.
TEST_F(IngestCheckpointTest, KnowsItsSceneByContent) {
  build_until(spec(), "build", 20);
  std::filesystem::rename(scene(), folder_.file("first.glb"));
  make_scene(2);
  try {
    build(spec());
    FAIL() << "built another scene";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
    EXPECT_NE(error.message().find("different contents"), std::string::npos) << error.what();
  }
  std::filesystem::copy(folder_.file("first.glb"), scene(),
                        std::filesystem::copy_options::overwrite_existing);
  EXPECT_GE(expect_to_resume(spec()).subvolumes_reused, 20u);
  EXPECT_GE(part_read(), 1);
}

// If a byte of the scene has changed after an interruption in scan or ingest, the resumed build
// reads the scene again, even if the modification time was set back.
TEST_F(IngestCheckpointTest, NoticesAChangeInPlace) {
  for (const char* stage : {"scan", "ingest"}) {
    SCOPED_TRACE(stage);
    build_until(often(), stage, 10000);
    const auto time = std::filesystem::last_write_time(scene());
    {
      std::fstream file(scene(), std::ios::in | std::ios::out | std::ios::binary);
      file.seekp(static_cast<std::streamoff>(std::filesystem::file_size(scene()) - 9));
      file.put('\x3a');
    }
    std::filesystem::last_write_time(scene(), time);
    const BuildReport report = build(spec());
    EXPECT_GE(part_read(), 1);
    BuildSpec fresh = spec();
    fresh.run.work_folder = folder_.file("fresh");
    fresh.run.durable_min_triangles = UINT64_MAX;
    EXPECT_EQ(report.sha256, build(fresh).sha256);
    std::filesystem::remove(output());
    make_scene(1);
  }
}

// If the times of a scene's separate buffer file have changed since an interruption, the resumed
// build reads this file again.
TEST_F(IngestCheckpointTest, NoticesAChangeOfABuffer) {
  const std::string glb = read_small_file(system_files(), scene(), UINT64_MAX);
  uint32_t json_size = 0;
  std::memcpy(&json_size, glb.data() + 12, sizeof json_size);
  std::string json = glb.substr(20, json_size);
  const std::string what = "\"buffers\":[{";
  ASSERT_NE(json.find(what), std::string::npos);
  json.insert(json.find(what) + what.size(), "\"uri\":\"corners.bin\",");
  std::ofstream(folder_.file("scene.gltf")) << json;
  const std::string buffer = folder_.file("corners.bin");
  std::ofstream(buffer) << glb.substr(28 + json_size);
  BuildSpec separate = spec();
  separate.geometry.scenes = {folder_.file("scene.gltf")};
  build_until(separate, "ingest", 10000);
  system_files().touch(buffer);
  EXPECT_EQ(build(separate).sha256, expected_);
  EXPECT_GT(files_.bytes_read[buffer], std::filesystem::file_size(buffer));
}

// If the stored triangles or the record of ingest are damaged, a warning names them, and the build
// reads the scene again.
TEST_F(IngestCheckpointTest, DamageIsHealed) {
  // Flips one bit in every `distance` bytes, from the fifth-last byte of the file backward.
  const auto flip = [&](uint64_t distance) {
    std::fstream file(durable(), std::ios::in | std::ios::out | std::ios::binary);
    for (int64_t at = static_cast<int64_t>(std::filesystem::file_size(durable())) - 5; at > 0;
         at -= static_cast<int64_t>(distance)) {
      file.seekg(at);
      const char byte = static_cast<char>(file.get() ^ 0x20);
      file.seekp(at);
      file.put(byte);
    }
  };
  const auto change_row = [&] {
    SqlDatabase(work() + "/job.db", SqlDatabase::Mode::kReadWrite)
        .execute("UPDATE ingest SET record = x'00' || record");
  };
  for (const char* stage : {"ingest", "build"})
    for (int kind = 0; kind < 5; ++kind) {
      SCOPED_TRACE(testing::Message() << stage << ", kind " << kind);
      build_until(often(), stage, stage == std::string("ingest") ? 20000 : 3, files_);
      if (kind == 0) flip(500);
      if (kind == 1) flip(UINT32_MAX);
      if (kind == 2) std::filesystem::remove(durable());
      if (kind == 3) std::filesystem::resize_file(durable(), 12345);
      if (kind == 4) change_row();
      EXPECT_EQ(build(spec()).sha256, expected_);
      EXPECT_NE(last_warning_.text.find(kind == 4 ? "row" : "triangles.vddurable"),
                std::string::npos)
          << last_warning_.text;
      std::filesystem::remove(output());
    }
}

// If an artifact is damaged and its triangles were already removed, the build reads the scene
// again.
TEST_F(IngestCheckpointTest, ReadsTheSceneForADamagedArtifact) {
  build_until(spec(), "merge", 0);
  std::filesystem::resize_file(work() + "/segment-0.vdseg", 1000);
  EXPECT_EQ(build(spec()).sha256, expected_);
  EXPECT_GE(part_read(), 1);
}

// If the triangles do not fit on the disk but fit in memory, the build works without checkpoints.
// If the disk becomes full during ingest, the build reads the scene again and keeps its triangles
// in memory.
TEST_F(IngestCheckpointTest, DoesWithoutDiskSpace) {
  files_.free_bytes = 3'000'000;
  EXPECT_EQ(build(spec()).sha256, expected_);
  EXPECT_NE(last_warning_.text.find("of disk at its peak"), std::string::npos);
  std::filesystem::remove(output());
  EXPECT_FALSE(files_.bytes_written.contains(durable()));
  files_.free_bytes = UINT64_MAX;
  files_.full_for = durable();
  EXPECT_EQ(build(spec()).sha256, expected_);
  EXPECT_NE(last_warning_.text.find("memory"), std::string::npos) << last_warning_.text;
}

// With `restart`, a build drops the ingested triangles and reads the scene again. A build of a
// small scene writes no checkpoints.
TEST_F(IngestCheckpointTest, StartsOverAndLeavesSmallScenesAlone) {
  build_until(spec(), "build", 0);
  BuildSpec again = spec();
  again.run.restart = true;
  expect_to_resume(again);
  EXPECT_GE(part_read(), 1);
  BuildSpec usual = spec();
  usual.run.durable_min_triangles = BuildSpec{}.run.durable_min_triangles;
  expect_to_resume(usual);
  EXPECT_FALSE(files_.bytes_written.contains(durable()));
}

// trusted_from_ns() returns the time after which every change of a file also changes the file's
// times. The result is one tick of the file system's clock after the last of the file's times,
// because a change within the same tick would not change these times.
TEST(TrustedFiles, AreOlderThanATickOfTheirClock) {
  constexpr int64_t kSecond = 1'000'000'000;
  const auto file = [](int64_t modified_ns, int64_t changed_ns) {
    return SourceFile{"a", FileIdentity{7, 100, modified_ns, changed_ns}};
  };
  EXPECT_EQ(trusted_from_ns({file(5 * kSecond + 1, 3 * kSecond)}), 5 * kSecond + 1 + kSecond / 10);
  EXPECT_EQ(trusted_from_ns({file(5, 9), file(3, 4)}), 9 + kSecond / 10);
  EXPECT_EQ(trusted_from_ns({file(4 * kSecond, 6 * kSecond)}), 8 * kSecond);
  EXPECT_EQ(trusted_from_ns({file(5, 9), SourceFile{"b", FileIdentity{}}}), INT64_MAX);
}

}  // namespace
}  // namespace voxdag
