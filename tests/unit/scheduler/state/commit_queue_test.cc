// Tests CommitQueue, which syncs groups of artifacts in the background. It never records the row of
// a subvolume before the bytes of its artifact are durable.
#include "scheduler/state/commit_queue.h"

#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <thread>

#include "core/base/error.h"
#include "core/base/memory_budget.h"
#include "core/io/forwarding_files.h"
#include "scheduler/triangles/durable_store.h"
#include "scheduler/triangles/memory_store.h"
#include "tests/support/error_of.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/core/format/test_artifacts.h"

namespace voxdag {
namespace {

// A disk whose file syncs can be blocked, or fail.
class SlowDisk : public ForwardingFiles {
 public:
  SlowDisk() : ForwardingFiles(system_files()) {}

  void block_syncs() {
    set([&] { blocked_ = true; });
  }
  void unblock_syncs() {
    set([&] { blocked_ = false; });
  }
  void fail_writes_from(int number) { failing_write_ = number; }  // the first write has number 1
  void fail_next_sync() { failing_sync_ = true; }
  int begun_syncs() {
    std::lock_guard lock(mutex_);
    return begun_;
  }
  // Returns once `count` syncs have begun.
  void wait_for_syncs(int count) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return begun_ >= count; });
  }
  std::unique_ptr<WritableFile> create(const std::string& path) override {
    return std::make_unique<File>(*this, ForwardingFiles::create(path));
  }

 private:
  class File : public ForwardingWriter {
   public:
    File(SlowDisk& disk, std::unique_ptr<WritableFile> file)
        : ForwardingWriter(std::move(file)), disk_(disk) {}
    void write_at(uint64_t offset, std::span<const std::byte> data) override {
      if (disk_.failing_write_ && ++disk_.writes_ >= *disk_.failing_write_)
        throw Error(ErrorCode::kNoSpace, "the test's disk is full");
      ForwardingWriter::write_at(offset, data);
    }
    void sync() override {
      std::unique_lock lock(disk_.mutex_);
      ++disk_.begun_;
      disk_.changed_.notify_all();
      disk_.changed_.wait(lock, [&] { return !disk_.blocked_; });
      if (std::exchange(disk_.failing_sync_, false))
        throw Error(ErrorCode::kIo, "the test's disk lost a write");
      ForwardingWriter::sync();
    }

   private:
    SlowDisk& disk_;
  };

  template <class Change>
  void set(Change change) {
    {
      std::lock_guard lock(mutex_);
      change();
    }
    changed_.notify_all();
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  int begun_ = 0, writes_ = 0;
  bool blocked_ = false, failing_sync_ = false;
  std::optional<int> failing_write_;
};

class CommitQueueTest : public testing::Test {
 protected:
  static constexpr uint32_t kLevels = 10, kBits = 64;
  static constexpr size_t kSubvolumes = 200;
  static constexpr uint64_t kGroup = 60000;  // size in bytes: a few artifacts
  static constexpr double kNeverS = 1e9;

  CommitQueueTest() {
    std::vector<StoredSubvolume> plan(kSubvolumes);
    for (size_t i = 0; i < plan.size(); ++i) plan[i].cube = {6, {static_cast<uint32_t>(i), 0, 0}};
    store_.start({"scene", "{}", 1}, plan);
    planned_ = store_.leaves();
  }
  // Writes the next subvolume's artifact and adds it to the queue.
  void build_one() { build_one(queue_); }
  void build_one(CommitQueue& queue) { build_one(queue, triangles_.add_part(kSceneBin)); }
  void build_one(CommitQueue& queue, BinId bin) {
    StoredSubvolume built = planned_[next_++];
    const SubDag rows = random_rows(next_, 500, kLevels, 2, kBits);
    ArtifactWriter writer(queue.segment(), {.grid_levels = kLevels, .hash_bits = kBits});
    writer.bricks({rows.brick_masks});
    for (const SubDag::Nodes& nodes : rows.levels) writer.nodes(nodes.view());
    built.artifact = writer.finish({});
    built.summary = {1, 1, 1, 1};
    queue.add_built(built, bin);
  }
  // Builds until a sync begins.
  void build_a_group() {
    for (const uint64_t before = segment_.size(); segment_.size() - before < kGroup;) build_one();
    disk_.wait_for_syncs(1);
  }
  // Returns the number of subvolumes that are recorded as built, as another process sees them.
  size_t recorded() {
    return built_in(JobStore(folder_.file("job.db"), JobStore::Access::kRead).leaves());
  }
  size_t announced() { return built_in(store_.leaves()) - recorded(); }
  size_t built_in(const std::vector<StoredSubvolume>& leaves) const {
    size_t built = 0;
    for (const StoredSubvolume& s : leaves) {
      if (s.state != SubvolumeState::kBuilt) continue;
      ++built;
      // Opens the artifact, which throws if its bytes are not in the file.
      ArtifactReader(system_files().open_read(segment_path(folder_.path(), s.artifact.segment)),
                     s.artifact);
    }
    return built;
  }

  TemporaryFolder folder_;
  SlowDisk disk_;
  MemoryBudget budget_{uint64_t{64} << 20};
  JobStore store_{folder_.file("job.db"), JobStore::Access::kBuild};
  MemoryStore triangles_{system_files(), folder_.file("spill"), false, budget_};
  CommitQueue queue_{store_, std::make_unique<SegmentWriter>(disk_, folder_.path(), 0, budget_),
                     triangles_, kNeverS, kGroup};
  SegmentWriter& segment_ = queue_.segment();
  std::vector<StoredSubvolume> planned_;
  size_t next_ = 0;
};

TEST_F(CommitQueueTest, TheWorkerContinuesWhileTheDiskWrites) {
  disk_.block_syncs();
  build_a_group();
  const size_t begun_with = next_;
  build_one();
  build_one();
  EXPECT_EQ(recorded(), 0u) << "a row came before its bytes were on the disk";
  disk_.unblock_syncs();
  queue_.commit();
  EXPECT_EQ(recorded(), begun_with + 2);
}

// If a sync is slow, the worker waits for it before the next group becomes too large.
TEST_F(CommitQueueTest, WaitsForADiskThatFallsBehind) {
  disk_.block_syncs();
  build_a_group();
  const size_t first_group = next_;
  std::thread disk([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    disk_.unblock_syncs();
  });
  const uint64_t behind = segment_.size();
  while (segment_.size() - behind < 6 * kGroup) build_one();
  EXPECT_GE(recorded(), first_group);
  disk.join();
  queue_.commit();
  EXPECT_EQ(recorded(), next_);
}

// If a sync fails, the queue never records this group or later ones, even if another sync succeeds:
// the system may have dropped the bytes that the first sync could not write.
TEST_F(CommitQueueTest, WhatAFailedSyncLostIsNotRecorded) {
  disk_.fail_next_sync();
  bool reported = false;
  for (int i = 0; i < 20 && !reported; ++i) try {
      build_one();
      queue_.commit();
    } catch (const Error& error) {
      reported = true;
      EXPECT_EQ(error.code(), ErrorCode::kIo);
    }
  EXPECT_TRUE(reported);
  queue_.commit();
  EXPECT_EQ(recorded(), 0u);
  build_one();
  EXPECT_THROW(queue_.commit(), Error);
  EXPECT_EQ(recorded(), 0u);
}

// finish() announces the last group without a sync, so that the merge can read it immediately.
// commit() makes the group durable.
TEST_F(CommitQueueTest, TheLastGroupIsDurableOnlyWhenAskedFor) {
  disk_.block_syncs();
  for (int i = 0; i < 3; ++i) build_one();
  queue_.finish();
  EXPECT_EQ(announced(), 3u);
  EXPECT_EQ(recorded(), 0u);
  EXPECT_EQ(disk_.begun_syncs(), 0);
  disk_.unblock_syncs();
  queue_.commit();
  EXPECT_EQ(announced(), 0u);
  EXPECT_EQ(recorded(), 3u);
}

// If the sync of one queue fails, the artifacts of the other queues are nevertheless recorded.
TEST_F(CommitQueueTest, FinishedQueuesBecomeDurableEachForItself) {
  CommitQueues queues;
  for (uint32_t id = 1; id <= 3; ++id) {
    auto segment = std::make_unique<SegmentWriter>(disk_, folder_.path(), id, budget_);
    auto queue = std::make_unique<CommitQueue>(store_, std::move(segment), triangles_, kNeverS);
    build_one(*queue);
    queue->finish();
    queues.add(std::move(queue));
  }
  EXPECT_EQ(announced(), 3u);
  disk_.fail_next_sync();
  EXPECT_EQ(error_of([&] { queues.commit(); }).code(), ErrorCode::kIo);
  EXPECT_EQ(recorded(), 2u);
  queues.commit();
  EXPECT_EQ(recorded(), 2u);
}

// If the job store cannot be written, a commit fails, although the artifacts are durable. A later
// commit records them.
TEST_F(CommitQueueTest, WhatTheJobStoreCannotStoreIsRecordedLater) {
  SqlDatabase store(folder_.file("job.db"), SqlDatabase::Mode::kReadWrite);
  store.execute(
      "CREATE TRIGGER full BEFORE UPDATE ON subvolume BEGIN SELECT RAISE(ABORT, 'full'); END");
  store.execute(
      "CREATE TRIGGER full2 BEFORE INSERT ON subvolume BEGIN SELECT RAISE(ABORT, 'full'); END");
  for (int i = 0; i < 3; ++i) build_one();
  queue_.finish();
  EXPECT_THROW(queue_.commit(), Error);
  EXPECT_EQ(recorded(), 0u);
  store.execute("DROP TRIGGER full; DROP TRIGGER full2");
  queue_.commit();
  EXPECT_EQ(recorded(), 3u);
}

// Triangles in a DurableStore, which a later run could read, are released only after their
// subvolume is recorded. So finish() waits until the last group is recorded.
TEST_F(CommitQueueTest, DurableTrianglesStayUntilTheirSubvolumesAreRecorded) {
  DurableStore durable(system_files(), folder_.file("triangles"), {}, folder_.file("spill"), false,
                       budget_);
  durable.add_cube_bins({&planned_[0].cube, 1});
  const BinId bin = durable.cube_bins()[0].bin;
  BinWriter writer(durable, {bin}, 1000);
  writer.append(0, FixedTriangle{});
  writer.flush();
  CommitQueue queue(store_, std::make_unique<SegmentWriter>(disk_, folder_.path(), 1, budget_),
                    durable, kNeverS);
  disk_.block_syncs();
  build_one(queue, bin);
  queue.commit_in_background();
  disk_.wait_for_syncs(1);
  EXPECT_EQ(durable.count(bin), 1u);
  EXPECT_EQ(recorded(), 0u);
  disk_.unblock_syncs();
  queue.finish();
  EXPECT_EQ(durable.count(bin), 0u);
  EXPECT_EQ(announced(), 0u);
}

// Artifacts that were written before the disk became full are recorded and readable.
TEST_F(CommitQueueTest, WhatAFullDiskStoredIsRecorded) {
  build_a_group();
  queue_.commit();
  const size_t before = next_;
  disk_.fail_writes_from(2);
  EXPECT_THROW(
      {
        while (next_ < kSubvolumes) build_one();
        queue_.commit();
      },
      Error);
  EXPECT_GE(recorded(), before + 1);
  EXPECT_LT(recorded(), next_);
}

}  // namespace
}  // namespace voxdag
