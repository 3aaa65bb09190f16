#include "scheduler/spec/memory_plan.h"

#include <gtest/gtest.h>

#include "merge/plan/merge_memory.h"
#include "scene/vertices/vertex_cache.h"

namespace voxdag {
namespace {

constexpr uint64_t kMiB = uint64_t{1} << 20, kGiB = uint64_t{1} << 30;
constexpr uint64_t kBudgets[] = {64 * kMiB, 100'000'000, kGiB, 12 * kGiB};
constexpr unsigned kThreads[] = {1, 2, 16, 1000};

// Fixes the division of some budgets. A change that shifts the balance between speed and memory
// makes this test fail.
TEST(MemoryPlan, DividesTheBudgetBetweenStages) {
  struct Expected {
    uint64_t budget, top_tree, triangles, partition, pilot;
  };
  for (const Expected& e : {Expected{64 * kMiB, 4 * kMiB, 22369621, 8 * kMiB, 48 * kMiB},
                            Expected{kGiB, 64 * kMiB, 357913941, 128 * kMiB, 768 * kMiB},
                            Expected{12 * kGiB, 768 * kMiB, 4 * kGiB, 1536 * kMiB, 9 * kGiB}}) {
    const MemoryPlan plan = MemoryPlan::divide(e.budget);
    EXPECT_EQ(plan.top_tree_bytes, e.top_tree);
    EXPECT_EQ(plan.triangle_bytes, e.triangles);
    EXPECT_EQ(plan.partition_buffer_bytes, e.partition);
    EXPECT_EQ(MemoryPlan::pilot_bytes(e.budget), e.pilot);
  }
}

// All workers get equal shares. If the shares would be too small for the smallest subvolume, there
// are fewer workers.
TEST(MemoryPlan, DividesWhatIsFreeBetweenWorkers) {
  struct Expected {
    uint64_t free;
    unsigned wanted, workers;
    uint64_t share;
  };
  constexpr uint64_t kBeside = 9 * kMiB + kMiB / 2;
  for (const Expected& e :
       {Expected{64 * kMiB, 2, 2, 32 * kMiB - kBeside},
        Expected{64 * kMiB, 16, 3, 64 * kMiB / 3 - kBeside},
        Expected{kGiB, 16, 16, 64 * kMiB - kBeside},
        Expected{12 * kGiB, 1000, 256, 48 * kMiB - kBeside}, Expected{kMiB, 4, 1, 0}}) {
    const WorkerMemory memory = WorkerMemory::divide(e.free, e.wanted);
    EXPECT_EQ(memory.workers, e.workers) << e.free;
    EXPECT_EQ(memory.share_bytes, e.share) << e.free;
  }
}

// Sizes of the parts into which a worker divides its share.
TEST(MemoryPlan, DividesAWorkersShare) {
  EXPECT_EQ(WorkerMemory::key_bytes(64 * kMiB), 56 * kMiB);
  EXPECT_EQ(BackendMemory::page_bytes(10 * kMiB), 8 * kMiB);
  EXPECT_EQ(BackendMemory::page_bytes(kGiB), 128 * kMiB);
  EXPECT_EQ(BackendMemory::page_bytes(512 * kMiB), 64 * kMiB);
  EXPECT_EQ(BackendMemory::page_bytes(12 * kGiB), 512 * kMiB);
  EXPECT_EQ(BackendMemory::table_bytes(64 * kMiB), 16 * kMiB);
  EXPECT_EQ(BackendMemory::plane_table_bytes(64 * kMiB, 64 * kMiB), 4 * kMiB);
  EXPECT_EQ(BackendMemory::plane_table_bytes(64 * kMiB, 16 * kMiB), 2 * kMiB);
  EXPECT_EQ(BackendMemory::block_memo_bytes(64 * kMiB), 4 * kMiB);
}

TEST(MemoryPlan, DividesTheMergesBudget) {
  const MergeMemory small = MergeMemory::divide(64 * kMiB, 2, kMiB);
  EXPECT_EQ(small.workers, 2u);
  EXPECT_EQ(small.worker_bytes, 8 * kMiB);
  EXPECT_EQ(small.resident_bytes, 64 * kMiB / 6);
  EXPECT_EQ(small.partition_bytes, 26214402u);
  const MergeMemory large = MergeMemory::divide(12 * kGiB, 16, kMiB);
  EXPECT_EQ(large.workers, 16u);
  EXPECT_EQ(large.worker_bytes, 192 * kMiB);
  EXPECT_EQ(large.resident_bytes, 2 * kGiB);
  EXPECT_EQ(large.partition_bytes, 5 * kGiB - 5 * kGiB / 16);
}

// Parts of the budget that are in use at the same time fit in the budget together.
TEST(MemoryPlan, PartsFitTheWhole) {
  for (const uint64_t budget : kBudgets) {
    const MemoryPlan plan = MemoryPlan::divide(budget);
    const uint64_t readers = MemoryPlan::ingest_workers(budget - plan.top_tree_bytes);
    uint64_t ingest =
        plan.top_tree_bytes + plan.triangle_bytes + readers * MemoryPlan::kIngestWorkerBytes;
    ingest += (budget - ingest) / VertexCache::kShareOfFree;
    EXPECT_LE(ingest, budget);
    EXPECT_LE(plan.triangle_bytes + plan.partition_buffer_bytes, budget);
    const uint64_t free = budget - plan.triangle_bytes;
    EXPECT_LE(plan.triangle_bytes + MemoryPlan::pilot_bytes(free), budget);
    for (const unsigned threads : kThreads) {
      const WorkerMemory memory = WorkerMemory::divide(free, threads);
      EXPECT_GE(memory.share_bytes, kSmallestBudget) << budget << " " << threads;
      EXPECT_LE(memory.workers * (memory.share_bytes + WorkerMemory::kOutsideShareBytes), free);
      const uint64_t share = memory.share_bytes;
      EXPECT_LE(WorkerMemory::key_bytes(share) + BackendMemory::page_bytes(share),
                share + BackendMemory::kMinPageBytes);
      EXPECT_LE(BackendMemory::table_bytes(share) + BackendMemory::block_memo_bytes(share) +
                    4 * BackendMemory::plane_table_bytes(share, share),
                share);
      const MergeMemory merge = MergeMemory::divide(budget, threads, kMiB);
      EXPECT_LE(
          merge.workers * merge.worker_bytes + 2 * merge.resident_bytes + merge.partition_bytes,
          budget);
    }
  }
}

}  // namespace
}  // namespace voxdag
