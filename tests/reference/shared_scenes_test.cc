// Builds of real scenes. The expected counts of voxels and nodes were computed by independent code.
// Run options do not affect the bytes.
#include <filesystem>

#include "core/format/global/diff.h"
#include "tests/reference/reference_build.h"

namespace reference {
namespace {

using voxdag::BuildReport;
using voxdag::BuildSpec;

class SharedScenes : public Reference {
 protected:
  // Chooses a scene and a resolution. Skips the test if the scene does not exist on this machine.
  void use(const std::string& name, uint64_t resolution) {
    const std::string path = std::string(VOXDAG_SHARED_SCENES) + "/" + name;
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "the shared scenes are not here: " << path;
    spec_.geometry.scenes = {path};
    spec_.geometry.resolution = resolution;
  }
  BuildReport run_with(uint64_t memory_bytes, uint64_t subvolume_edge, unsigned threads) {
    spec_.run.memory_bytes = memory_bytes;
    spec_.run.subvolume_edge = subvolume_edge;
    spec_.run.threads = threads;
    return run(spec_);
  }
  BuildSpec spec_;
};

#define USE_SHARED_SCENE(name, resolution) \
  use(name, resolution);                   \
  if (IsSkipped()) return

TEST_F(SharedScenes, Sponza4096) {
  USE_SHARED_SCENE("sponza.glb", 4096);
  const BuildReport whole = run_with(8192 * kMebibyte, 4096, 1);
  EXPECT_EQ(whole.merge.voxels, 159880556u);
  EXPECT_EQ(whole.merge.svo_nodes, 12800213u);
  EXPECT_EQ(whole.merge.dag_nodes, 502482u);
  EXPECT_EQ(whole.subvolumes, 1u);
  EXPECT_EQ(whole.spill_bytes, 0u);

  const BuildReport fine = run_with(64 * kMebibyte, 128, 2);
  EXPECT_EQ(fine.sha256, whole.sha256);
  EXPECT_GT(fine.subvolumes, 4000u);
  EXPECT_GT(fine.spill_bytes, 0u);
  EXPECT_GT(fine.merge.passes, 1u);
  const BuildReport split = run_with(64 * kMebibyte, 4096, 1);
  EXPECT_EQ(split.sha256, whole.sha256);
  EXPECT_GT(split.subvolumes_split, 0u);
  EXPECT_EQ(run_with(256 * kMebibyte, 256, 1).sha256, whole.sha256);
  EXPECT_EQ(run_with(64 * kMebibyte, 1024, 2).sha256, whole.sha256);
  EXPECT_EQ(run_with(64 * kMebibyte, 0, 1).sha256, whole.sha256);
  EXPECT_EQ(run_with(0, 0, 0).sha256, whole.sha256);
}

TEST_F(SharedScenes, Dragon8192) {
  USE_SHARED_SCENE("dragon_100k.glb", 8192);
  const BuildReport whole = run_with(8192 * kMebibyte, 8192, 2);
  EXPECT_EQ(whole.merge.voxels, 172785494u);
  EXPECT_EQ(whole.merge.svo_nodes, 14381671u);
  EXPECT_EQ(whole.merge.dag_nodes, 2616127u);
  EXPECT_EQ(whole.subvolumes_split, 0u);

  const BuildReport split = run_with(64 * kMebibyte, 8192, 1);
  EXPECT_EQ(split.sha256, whole.sha256);
  EXPECT_GT(split.subvolumes_split, 0u);

  const BuildReport rounds = run_with(64 * kMebibyte, 512, 2);
  EXPECT_EQ(rounds.sha256, whole.sha256);
  EXPECT_GT(rounds.merge.passes, 1u);
  EXPECT_GT(rounds.spill_bytes, 10 * kMebibyte);
}

// Truncated hashes change the order of the nodes in the file, but not the voxels or the number of
// nodes.
TEST_F(SharedScenes, HashBits) {
  USE_SHARED_SCENE("sponza.glb", 512);
  const BuildReport full = run_with(256 * kMebibyte, 512, 1);
  for (const uint32_t hash_bits : {4u, 16u}) {
    SCOPED_TRACE(hash_bits);
    spec_.geometry.hash_bits = hash_bits;
    const BuildReport cut = run_with(256 * kMebibyte, 512, 1);
    EXPECT_NE(cut.sha256, full.sha256);
    EXPECT_EQ(cut.merge.dag_nodes, full.merge.dag_nodes);
    voxdag::MemoryBudget budget(1024 * kMebibyte);
    voxdag::CancelToken never;
    const auto difference = voxdag::diff_global_files(
        voxdag_reader::File(full.output), voxdag_reader::File(cut.output), 2, budget, never);
    EXPECT_EQ(difference.only_a, 0u);
    EXPECT_EQ(difference.only_b, 0u);
    EXPECT_EQ(run_with(64 * kMebibyte, 64, 2).sha256, cut.sha256);
    EXPECT_EQ(run_with(1024 * kMebibyte, 128, 1).sha256, cut.sha256);
  }
}

}  // namespace
}  // namespace reference
