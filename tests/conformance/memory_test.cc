// The memory guarantees of a backend. The outcome for a cube that does not fit in the budget is
// kNeedsSplit. The smallest cube always fits.
#include <malloc.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "tests/conformance/harness.h"

namespace {

// Bytes currently allocated by `new`, and their maximum. A backend may allocate only little memory
// (kUncharged) without charging it to the budget.
std::atomic<int64_t> g_heap{0}, g_heap_peak{0};

void* counted(void* block) {
  if (!block) throw std::bad_alloc();
  const auto size = static_cast<int64_t>(malloc_usable_size(block));
  const int64_t now = g_heap += size;
  int64_t peak = g_heap_peak;
  while (peak < now && !g_heap_peak.compare_exchange_weak(peak, now)) {
  }
  return block;
}

void uncounted(void* block) {
  if (block) g_heap -= static_cast<int64_t>(malloc_usable_size(block));
  std::free(block);
}

}  // namespace

void* operator new(size_t bytes) { return counted(std::malloc(bytes)); }
void* operator new(size_t bytes, std::align_val_t align) {
  const auto a = static_cast<size_t>(align);
  return counted(std::aligned_alloc(a, (bytes + a - 1) / a * a));
}
void operator delete(void* block) noexcept { uncounted(block); }
void operator delete(void* block, size_t) noexcept { uncounted(block); }
void operator delete(void* block, std::align_val_t) noexcept { uncounted(block); }
void operator delete(void* block, size_t, std::align_val_t) noexcept { uncounted(block); }

namespace voxdag {
namespace {

using Memory = Conformance;
VOXDAG_FOR_ALL_BACKENDS(Memory);

constexpr int64_t kUncharged = int64_t{1} << 20;  // bytes allowed without a charge

// A stream of `count` triangles that repeats the triangles of `unique`.
class EndlessStream : public TriangleStream {
 public:
  EndlessStream(const oracle::Triangles& unique, uint64_t count)
      : unique_(oracle::fixed(unique)), count_(count) {}
  uint64_t count() const override { return count_; }
  void rewind() override { next_ = 0; }
  size_t read(std::span<FixedTriangle> out) override {
    size_t n = 0;
    for (; n < out.size() && next_ < count_; ++n, ++next_) {
      // Each repetition begins with another vertex, so that equal triangles have different bytes.
      const FixedTriangle& t = unique_[next_ * 7919 % unique_.size()];
      for (size_t i = 0; i < 3; ++i)
        std::copy_n(t.v[(i + next_ / unique_.size()) % 3], 3, out[n].v[i]);
    }
    return n;
  }

 private:
  std::vector<FixedTriangle> unique_;
  uint64_t count_, next_ = 0;
};

// The smallest cube fits in the smallest budget, however many triangles there are, and the
// uncharged memory is small.
TEST_P(Memory, SmallestCubeFitsWithAnyTriangles) {
  const auto backend = open();
  const SubvolumeTask task{14, {8, {200, 3, 117}}, 64};  // a cube of 64 voxels per edge
  const oracle::Region region = oracle::region_of(task.cube, task.grid_levels);
  for (const oracle::SceneKind kind : oracle::kAllKinds) {
    SCOPED_TRACE(oracle::kind_name(kind));
    const bool small =
        kind == oracle::SceneKind::kSubVoxel || kind == oracle::SceneKind::kDegenerate;
    const auto unique = oracle::make_scene(kind, 9, region, small ? 1000 : 50);
    EndlessStream stream(unique, small ? 300000 : 4000);
    const int64_t before = g_heap;
    g_heap_peak = before;
    const Built built = build(*backend, task, stream, kSmallestBudget);
    EXPECT_LE(g_heap_peak - before, static_cast<int64_t>(kSmallestBudget) + kUncharged);
    expect_equals(built, oracle::build_dag(oracle::voxelize(unique, region), 64), task);
  }
}

// The smallest cube also fits if over 3900 of its 4096 bricks are different, nearly the worst case.
TEST_P(Memory, SmallestCubeFitsWithAllBricksDifferent) {
  const SubvolumeTask task{20, {14, {16383, 0, 5000}}, 64};
  const oracle::Region region = oracle::region_of(task.cube, task.grid_levels);
  const auto scene = oracle::make_scene(oracle::SceneKind::kSubVoxel, 10, region, 30000);
  const oracle::Dag truth = oracle::build_dag(oracle::voxelize(scene, region), 64);
  EXPECT_GT(truth.bricks.size(), 3900u);
  expect_equals(build(*open(), task, scene, kSmallestBudget), truth, task);
}

// Builds a cube with the smallest budget. If it does not fit, builds its eight children instead,
// recursively.
class Splitter {
 public:
  Splitter(Backend& backend, uint32_t grid_levels, const oracle::Triangles& scene)
      : backend_(backend), grid_levels_(grid_levels), scene_(scene) {}
  uint64_t splits = 0, voxels = 0;

  void build_cube(const Cube& cube) {
    oracle::VectorStream stream(oracle::fixed(scene_));
    const Built built = build(backend_, {grid_levels_, cube, 64}, stream, kSmallestBudget);
    if (built.outcome == BuildOutcome::kNeedsSplit) {
      ++splits;
      ASSERT_GT(cube.edge_voxels(grid_levels_), kSmallestEdge);
      for (int c = 0; c < 8; ++c) build_cube(cube.child(c));
      return;
    }
    voxels += built.summary.voxels;
  }

 private:
  Backend& backend_;
  const uint32_t grid_levels_;
  const oracle::Triangles& scene_;
};

// If a cube must be split, its parts together have the same voxels as the cube.
TEST_P(Memory, CubesThatNeedASplitCanBeSplit) {
  const auto backend = open();
  const Cube cube{1, {1, 1, 0}};  // a cube of 512 voxels per edge
  const auto scene =
      oracle::make_scene(oracle::SceneKind::kSpanning, 11, oracle::region_of(cube, 10), 100);
  const Built whole = build(*backend, {10, cube, 64}, scene);
  ASSERT_EQ(whole.outcome, BuildOutcome::kBuilt);
  Splitter splitter(*backend, 10, scene);
  splitter.build_cube(cube);
  EXPECT_GT(splitter.splits, 0u);
  EXPECT_EQ(splitter.voxels, whole.summary.voxels);
}

// For any budget, from far too small to ample, the outcome is a split or the correct result. The
// memory from `new` is within the budget.
TEST_P(Memory, AnyBudgetNeedsASplitOrGivesTheResult) {
  const auto backend = open();
  const SubvolumeTask task{9, {}, 16};
  const auto scene =
      oracle::make_scene(oracle::SceneKind::kSpanning, 12, oracle::region_of({}, 9), 60);
  const Built whole = build(*backend, task, scene);
  int too_small = 0, built = 0;
  for (uint64_t budget = kSmallestBudget / 64; budget <= kAmpleBudget; budget += budget / 2) {
    SCOPED_TRACE(budget);
    oracle::VectorStream stream(oracle::fixed(scene));
    const int64_t before = g_heap;
    g_heap_peak = before;
    const Built one = build(*backend, task, stream, budget);
    if (one.outcome == BuildOutcome::kNeedsSplit) {
      ++too_small;
      EXPECT_LE(g_heap_peak - before, static_cast<int64_t>(budget) + kUncharged);
    } else {
      ++built;
      EXPECT_TRUE(one.dag == whole.dag);
    }
  }
  EXPECT_GT(too_small, 0);
  EXPECT_GT(built, 0);
}

}  // namespace
}  // namespace voxdag
