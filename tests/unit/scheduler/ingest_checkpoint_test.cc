// Scan, ingest and hand-down of a scene that is worth keeping survive an interruption: what was
// done is not done again, and never mistaken for that of another scene.
#include "scheduler/ingest/ingest_checkpoint.h"

#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "tests/unit/io/temporary_folder.h"
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

class KeptIngestTest : public testing::Test {
 protected:
  void SetUp() override {
    make_scene(1);
    BuildSpec plain = spec();
    plain.run.kept_from_triangles = UINT64_MAX;
    const BuildReport report = build(plain);
    expected_ = report.sha256;
    subvolumes_ = report.subvolumes;
    whole_ = files_.bytes_read[scene()];
    EXPECT_FALSE(files_.bytes_written.contains(kept()));
    std::filesystem::remove(output());
  }
  void make_scene(uint64_t seed) const { write_spheres(scene(), 24000, seed); }
  std::string scene() const { return folder_.file("scene.glb"); }
  std::string output() const { return folder_.file("out.vdag"); }
  std::string work() const { return output() + ".work"; }
  std::string kept() const { return work() + "/triangles.vdkept"; }

  // Keeps the scene at the ends of scan, ingest and hand-down.
  BuildSpec spec() const {
    BuildSpec spec = spheres_build(scene(), output());
    spec.run.checkpoint_interval_s = 1e9;
    spec.run.kept_from_triangles = 1;
    return spec;
  }
  // And after every batch of triangles.
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
  // Goes on, to the right bytes, without a warning.
  BuildReport expect_to_go_on(const BuildSpec& spec) {
    const BuildReport report = build(spec);
    EXPECT_EQ(report.sha256, expected_);
    EXPECT_EQ(last_warning_.text, "");
    EXPECT_FALSE(std::filesystem::exists(work()));
    std::filesystem::remove(output());
    return report;
  }
  // Of what a build reads of the scene that reads all of it.
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

// Interrupted at any point, a build goes on there: it reads what it had not read of the scene, and
// nothing once that is ingested.
TEST_F(KeptIngestTest, GoesOnWhereItWas) {
  struct Moment {
    const char* stage;
    uint64_t after;
    double least, most;  // part of the scene that is read afterwards
  };
  for (const Moment& moment :
       {Moment{"scan", 12000, 0.6, 0.9}, Moment{"ingest", 4096, 0.3, 0.6},
        Moment{"ingest", 20000, 0.01, 0.3}, Moment{"build", 0, 0, 0}, Moment{"merge", 0, 0, 0}}) {
    SCOPED_TRACE(std::string(moment.stage) + " after " + std::to_string(moment.after));
    build_until(often(), moment.stage, moment.after, files_);
    expect_to_go_on(often());
    EXPECT_GE(part_read(), moment.least);
    EXPECT_LE(part_read(), moment.most);
  }
}

// Hand-down, too, goes on from each of its checkpoints.
TEST_F(KeptIngestTest, GoesOnAmidHandDown) {
  build(often());
  std::filesystem::remove(output());
  const uint64_t syncs = files_.syncs[kept()];
  ASSERT_GT(syncs, 20u);
  for (const uint64_t at : {syncs, syncs - 1, syncs - 12}) {
    SCOPED_TRACE(testing::Message() << "sync " << at << " of " << syncs);
    files_.failing_sync[kept()] = at;
    EXPECT_THROW(build(often()), Error);
    files_.failing_sync.clear();
    const uint64_t first_run = files_.bytes_written[kept()];
    expect_to_go_on(often());
    EXPECT_EQ(part_read(), 0);
    EXPECT_LT(files_.bytes_written[kept()], first_run);
  }
}

// Run options may change in between: subvolumes that are split since find their triangles, and so
// do those that were built before.
TEST_F(KeptIngestTest, RunOptionsMayChange) {
  for (const char* stage : {"ingest", "build"}) {
    SCOPED_TRACE(stage);
    build_until(spec(), stage, 10);
    BuildSpec other = spec();
    other.run.subvolume_edge = 64;
    other.run.memory_bytes = uint64_t{64} << 20;
    other.run.threads = 3;
    build_until(other, "build", 15);
    const BuildReport report = expect_to_go_on(other);
    EXPECT_GT(report.subvolumes_reused, 0u);
    EXPECT_GT(report.subvolumes, subvolumes_);
    EXPECT_EQ(part_read(), 0);
  }
}

// Space is given back as subvolumes are recorded.
TEST_F(KeptIngestTest, GivesBackWhatIsBuilt) {
  build_until(spec(), "build", 0);
  const uint64_t all = std::filesystem::file_size(kept());
  build_until(spec(), "build", subvolumes_ / 2, files_);
  EXPECT_GT(files_.bytes_released[kept()], all / 4);
  EXPECT_TRUE(std::filesystem::exists(kept()));
  build_until(spec(), "merge", 0);
  EXPECT_FALSE(std::filesystem::exists(kept()));
  expect_to_go_on(spec());
}

// Another scene under the same name is refused, and takes nothing from the job; the first one, back
// again, goes on though its times have changed.
TEST_F(KeptIngestTest, KnowsItsSceneByContent) {
  build_until(spec(), "build", 20);
  std::filesystem::rename(scene(), folder_.file("first.glb"));
  make_scene(2);
  try {
    build(spec());
    FAIL() << "built another scene";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
    EXPECT_NE(error.message().find("other contents"), std::string::npos) << error.what();
  }
  std::filesystem::copy(folder_.file("first.glb"), scene(),
                        std::filesystem::copy_options::overwrite_existing);
  EXPECT_GE(expect_to_go_on(spec()).subvolumes_reused, 20u);
  EXPECT_GE(part_read(), 1);
}

// A byte that changes in place, the time of modification set back, is a change; so is one that
// comes amid ingest.
TEST_F(KeptIngestTest, NoticesAChangeInPlace) {
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
    fresh.run.kept_from_triangles = UINT64_MAX;
    EXPECT_EQ(report.sha256, build(fresh).sha256);
    std::filesystem::remove(output());
    make_scene(1);
  }
}

// So is a change of a buffer beside the scene.
TEST_F(KeptIngestTest, NoticesAChangeOfABuffer) {
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

// What the disk changes is named, and made again from the scene.
TEST_F(KeptIngestTest, DamageIsHealed) {
  // One bit in every so many bytes, but for the last few.
  const auto flip = [&](uint64_t distance) {
    std::fstream file(kept(), std::ios::in | std::ios::out | std::ios::binary);
    for (int64_t at = static_cast<int64_t>(std::filesystem::file_size(kept())) - 5; at > 0;
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
      if (kind == 2) std::filesystem::remove(kept());
      if (kind == 3) std::filesystem::resize_file(kept(), 12345);
      if (kind == 4) change_row();
      EXPECT_EQ(build(spec()).sha256, expected_);
      EXPECT_NE(last_warning_.text.find(kind == 4 ? "row" : "triangles.vdkept"), std::string::npos)
          << last_warning_.text;
      std::filesystem::remove(output());
    }
}

// An artifact that is damaged when the triangles are gone brings them back from the scene.
TEST_F(KeptIngestTest, ReadsTheSceneForADamagedArtifact) {
  build_until(spec(), "merge", 0);
  std::filesystem::resize_file(work() + "/segment-0.vdseg", 1000);
  EXPECT_EQ(build(spec()).sha256, expected_);
  EXPECT_GE(part_read(), 1);
}

// Where the disk has no room for what memory can hold, nothing is kept; where it turns out to have
// none, the triangles move to memory.
TEST_F(KeptIngestTest, DoesWithoutRoomOnTheDisk) {
  files_.free_bytes = 3'000'000;
  expect_to_go_on(spec());
  EXPECT_FALSE(files_.bytes_written.contains(kept()));
  files_.free_bytes = UINT64_MAX;
  files_.full_for = kept();
  EXPECT_EQ(build(spec()).sha256, expected_);
  EXPECT_NE(last_warning_.text.find("memory"), std::string::npos) << last_warning_.text;
}

// Starting over forgets what was ingested; a small scene has nothing kept.
TEST_F(KeptIngestTest, StartsOverAndLeavesSmallScenesAlone) {
  build_until(spec(), "build", 0);
  BuildSpec again = spec();
  again.run.restart = true;
  expect_to_go_on(again);
  EXPECT_GE(part_read(), 1);
  BuildSpec usual = spec();
  usual.run.kept_from_triangles = BuildSpec{}.run.kept_from_triangles;
  expect_to_go_on(usual);
  EXPECT_FALSE(files_.bytes_written.contains(kept()));
}

// Times are trusted once the clock has moved on since, by what it counts in.
TEST(SettledFiles, AreOlderThanTheClockIsCoarse) {
  constexpr int64_t kSecond = 1'000'000'000;
  const auto file = [](int64_t modified_ns, int64_t changed_ns) {
    return SourceFile{"a", FileIdentity{7, 100, modified_ns, changed_ns}};
  };
  EXPECT_EQ(settled_ns({file(5 * kSecond + 1, 3 * kSecond)}), 5 * kSecond + 1 + kSecond / 10);
  EXPECT_EQ(settled_ns({file(5, 9), file(3, 4)}), 9 + kSecond / 10);
  EXPECT_EQ(settled_ns({file(4 * kSecond, 6 * kSecond)}), 8 * kSecond);
  EXPECT_EQ(settled_ns({file(5, 9), SourceFile{"b", FileIdentity{}}}), INT64_MAX);
}

}  // namespace
}  // namespace voxdag
