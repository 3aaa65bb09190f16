// Builds that omit cut-out parts of surfaces resume after an interruption. If an image has changed,
// they start over.
#include <gtest/gtest.h>

#include <filesystem>

#include "scheduler/spec/memory_plan.h"
#include "scheduler/state/checkpoint/ingest_checkpoint.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/scheduler/cutout_scene.h"
#include "tests/unit/scheduler/interruptions.h"
#include "tests/unit/scheduler/metered_files.h"

namespace voxdag {
namespace {

class CutoutCheckpointTest : public testing::Test {
 protected:
  void SetUp() override {
    write_leaf_image(folder_.path(), 3);
    scene_ = write_leaves(folder_.path(), 25000);
    expected_ = fresh_digest();
  }
  // Returns a build that writes a checkpoint after every piece of the scene.
  BuildSpec spec() const {
    BuildSpec spec;
    spec.geometry.scenes = {scene_};
    spec.geometry.resolution = 128;
    spec.geometry.cutouts = CutoutRule::kSkip;
    spec.run.output = folder_.file("out.vdag");
    spec.run.memory_bytes = uint64_t{128} << 20;
    spec.run.threads = 1;
    spec.run.checkpoint_interval_s = 0;
    spec.run.durable_min_triangles = 1;
    return spec;
  }
  std::string digest(const BuildSpec& spec) {
    files_.forget_counts();
    NoProgress progress;
    CancelToken cancel;
    const std::string sha256 = run_build(spec, {files_, progress, cancel}).sha256;
    std::filesystem::remove(spec.run.output);
    return sha256;
  }
  // Returns the digest of a build without checkpoints.
  std::string fresh_digest() {
    BuildSpec fresh = spec();
    fresh.run.output = folder_.file("fresh.vdag");
    fresh.run.durable_min_triangles = UINT64_MAX;
    const std::string sha256 = digest(fresh);
    whole_ = files_.bytes_read[scene_];
    return sha256;
  }
  // Returns the fraction of the scene file that the last build read, relative to a complete build.
  double part_read() {
    return static_cast<double>(files_.bytes_read[scene_]) / static_cast<double>(whole_);
  }

  TemporaryFolder folder_;
  MeteredFiles files_;
  std::string scene_, expected_;
  uint64_t whole_ = 0;
};

TEST_F(CutoutCheckpointTest, ResumesWhereItWas) {
  struct Moment {
    const char* stage;
    uint64_t after;
    double max_read;
  };
  for (const Moment& moment :
       {Moment{"scan", 40000, 0.99}, Moment{"ingest", 20000, 0.8}, Moment{"ingest", 45000, 0.4},
        Moment{"build", 0, 0}, Moment{"merge", 0, 0}}) {
    SCOPED_TRACE(std::string(moment.stage) + " after " + std::to_string(moment.after));
    build_until(spec(), moment.stage, moment.after, files_);
    EXPECT_EQ(digest(spec()), expected_);
    EXPECT_LE(part_read(), moment.max_read);
  }
}

TEST_F(CutoutCheckpointTest, NoticesAChangeOfAnImage) {
  for (const char* stage : {"scan", "ingest"}) {
    build_until(spec(), stage, 20000, files_);
    write_leaf_image(folder_.path(), 2);
    const std::string changed = fresh_digest();
    EXPECT_NE(changed, expected_);
    EXPECT_EQ(digest(spec()), changed);
    EXPECT_GE(part_read(), 1);
    write_leaf_image(folder_.path(), 3);
  }
}

// A build begins while the leaf's texture is missing, so it keeps the complete surfaces of the
// leaf. If the texture appears before the build resumes, the result is the same as if the texture
// had been present from the beginning.
TEST_F(CutoutCheckpointTest, NoticesANewImage) {
  const std::string image = folder_.file("leaf.png"), other = folder_.file("other.png");
  std::filesystem::rename(image, other);
  EXPECT_NE(fresh_digest(), expected_);
  build_until(spec(), "ingest", 20000, files_);
  std::filesystem::rename(other, image);
  EXPECT_EQ(digest(spec()), expected_);
}

TEST_F(CutoutCheckpointTest, OptionsOfCutoutsAreOtherBuilds) {
  build_until(spec(), "ingest", 20000, files_);
  BuildSpec keep = spec();
  keep.geometry.cutouts = CutoutRule::kKeep;
  const std::string kept = digest(keep);
  EXPECT_NE(kept, expected_);
  build_until(keep, "ingest", 20000, files_);
  EXPECT_EQ(digest(spec()), expected_);
}

// The estimated disk space includes the patches into which cut triangles are divided, because they
// are stored like triangles. This matters if a small scene has many patches.
TEST_F(CutoutCheckpointTest, DiskSpaceOfPatches) {
  BuildSpec small = spec();
  small.run.durable_min_triangles = 1000;
  const auto memory =
      static_cast<double>(MemoryPlan::divide(small.run.memory_bytes).triangle_bytes);
  EXPECT_EQ(max_disk_bytes(small, 2, 2), 0);
  const double large = max_disk_bytes(small, 1000, 10'000'000);
  EXPECT_GT(large, 2 * 36e7);
  EXPECT_EQ(max_disk_bytes(small, 10'000'000, 1000), large);
  EXPECT_EQ(max_disk_bytes(small, 2, 10'000'000), large - memory);
}

}  // namespace
}  // namespace voxdag
