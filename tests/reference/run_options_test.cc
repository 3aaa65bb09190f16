// Run options, copies of triangles and the order of work do not affect the bytes of the file. The
// tests check in the reports that the builds did spill, split and merge in different ways.
#include <algorithm>

#include "tests/reference/reference_build.h"

namespace reference {
namespace {

using RunOptionsTest = Reference;
using voxdag::BuildReport;

Triangles mixed_scene(int resolution, int of_each_kind) {
  Triangles scene;
  for (const oracle::SceneKind kind : oracle::kAllKinds) {
    if (kind == oracle::SceneKind::kWide) continue;
    for (const auto& t : oracle::make_scene(kind, 1, {{0, 0, 0}, resolution}, of_each_kind))
      scene.push_back(t);
  }
  return scene;
}

// Builds with different subvolume sizes, threads and budgets give the oracle's DAG.
TEST_F(RunOptionsTest, NeverShow) {
  const Triangles scene = mixed_scene(256, 12);
  for (const uint32_t hash_bits : {4u, 16u, 64u}) {
    SCOPED_TRACE(testing::Message() << "hash bits " << hash_bits);
    auto spec = spec_for(scene, 256);
    spec.geometry.hash_bits = hash_bits;
    spec.run.subvolume_edge = 256;
    const auto whole = expect_right(scene, 256, spec);
    EXPECT_EQ(whole.subvolumes, 1u);
    uint64_t max_subvolumes = 0;
    for (const uint64_t edge : {0, 64, 128})
      for (const unsigned threads : {1u, 2u})
        for (const uint64_t memory : {64 * kMebibyte, 1024 * kMebibyte}) {
          SCOPED_TRACE(testing::Message() << "subvolumes of " << edge << ", " << threads
                                          << " threads, " << memory << " bytes");
          spec.run.subvolume_edge = edge;
          spec.run.threads = threads;
          spec.run.memory_bytes = memory;
          const auto report = run(spec);
          EXPECT_EQ(report.sha256, whole.sha256);
          EXPECT_TRUE(contents(report.output) == contents(whole.output));
          EXPECT_EQ(report.threads, threads);
          EXPECT_EQ(report.memory_bytes, memory);
          max_subvolumes = std::max(max_subvolumes, report.subvolumes);
        }
    EXPECT_GT(max_subvolumes, 40u);
  }
}

// Triangles that do not fit in memory are spilled to disk. The bytes are the same as without
// spilling.
TEST_F(RunOptionsTest, SpillingNeverShows) {
  Triangles scene = mixed_scene(128, 2);
  for (const auto& t : oracle::make_scene(oracle::SceneKind::kSubVoxel, 2, {{0, 0, 0}, 128}, 2000))
    scene.push_back(t);
  const auto plain = expect_right(scene, 128, spec_for(scene, 128));
  EXPECT_EQ(plain.spill_bytes, 0u);
  auto spec = spec_for(scene, 128, 500);
  spec.run.memory_bytes = 64 * kMebibyte;
  for (const uint64_t edge : {64, 128}) {
    spec.run.subvolume_edge = edge;
    spec.run.threads = edge == 64 ? 2 : 1;
    const auto report = run(spec);
    EXPECT_EQ(report.sha256, plain.sha256);
    EXPECT_GT(report.triangles, 900000u);
    EXPECT_GT(report.spill_bytes, 10 * kMebibyte);
  }
}

// Subvolumes that exceed their share of the memory are split into their eight children. The bytes
// are the same as without splits.
TEST_F(RunOptionsTest, SplittingNeverShows) {
  const Triangles scene =
      oracle::make_scene(oracle::SceneKind::kSpanning, 3, {{0, 0, 0}, 1024}, 400);
  auto spec = spec_for(scene, 1024);
  spec.run.subvolume_edge = 1024;
  spec.run.memory_bytes = 4096 * kMebibyte;
  const auto whole = run(spec);
  EXPECT_EQ(whole.subvolumes_split, 0u);
  for (const unsigned threads : {1u, 2u}) {
    spec.run.memory_bytes = 64 * kMebibyte;
    spec.run.threads = threads;
    const auto split = run(spec);
    EXPECT_GT(split.subvolumes_split, 0u);
    EXPECT_EQ(split.sha256, whole.sha256);
  }
}

// With few hash bits, the nodes are in another order in the file, but the DAG has the same counts
// and voxels. Run options do not affect the bytes of these files either.
TEST_F(RunOptionsTest, HashBitsChangeTheOrderOnly) {
  const Triangles scene = oracle::make_scene(oracle::SceneKind::kSpanning, 4, {{0, 0, 0}, 512}, 60);
  auto spec = spec_for(scene, 512);
  spec.run.subvolume_edge = 512;
  const auto full = run(spec);
  for (const uint32_t hash_bits : {4u, 16u}) {
    SCOPED_TRACE(hash_bits);
    spec.geometry.hash_bits = hash_bits;
    spec.run = {};
    spec.run.subvolume_edge = 512;
    spec.run.threads = 1;
    const auto cut = run(spec);
    EXPECT_NE(cut.sha256, full.sha256);
    EXPECT_EQ(cut.merge.voxels, full.merge.voxels);
    EXPECT_EQ(cut.merge.svo_nodes, full.merge.svo_nodes);
    EXPECT_EQ(cut.merge.dag_nodes, full.merge.dag_nodes);
    for (const uint64_t edge : {64, 128}) {
      spec.run.subvolume_edge = edge;
      spec.run.threads = 2;
      spec.run.memory_bytes = 64 * kMebibyte;
      EXPECT_EQ(run(spec).sha256, cut.sha256);
    }
  }
}

}  // namespace
}  // namespace reference
