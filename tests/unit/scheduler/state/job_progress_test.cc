// The state of an unfinished build, as other processes see it.
#include "scheduler/state/job_progress.h"

#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <future>
#include <mutex>
#include <thread>

#include "scheduler/state/job_store.h"
#include "scheduler/state/work_folder.h"
#include "tests/support/temporary_folder.h"

namespace voxdag {
namespace {

// Blocks the first thread that writes a snapshot, until the test releases it.
class BlockingProgress : public NoProgress {
 public:
  void end_stage() override {
    std::lock_guard lock(mutex_);
    ++ended_;
    changed_.notify_all();
  }
  void set_usage(uint64_t, uint64_t) override {
    std::unique_lock lock(mutex_);
    if (blocked_) return;
    blocked_ = true;
    changed_.notify_all();
    changed_.wait(lock, [&] { return released_; });
  }
  void wait_until_blocked() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return blocked_; });
  }
  void wait_for_ended(int count) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return ended_ >= count; });
  }
  void release() {
    std::lock_guard lock(mutex_);
    released_ = true;
    changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool blocked_ = false, released_ = false;
  int ended_ = 0;
};

// A thread that had to wait for its turn writes the state at the end of its wait, not at the
// beginning. Otherwise the job store could keep an old state at the end of a stage.
TEST(JobProgressTest, WritesTheNewestSnapshot) {
  const TemporaryFolder folder;
  CancelToken cancel;
  NoProgress quiet;
  WorkFolder work({system_files(), quiet, cancel}, folder.path() + "/work", 0);
  JobStore store(work.store_path(), JobStore::Access::kBuild);
  BlockingProgress shown;
  JobProgress progress(shown, store, work, false, 0);
  auto begun = std::async(std::launch::async, [&] { progress.begin_stage("build", 100, "parts"); });
  shown.wait_until_blocked();
  auto ended = std::async(std::launch::async, [&] { progress.end_stage(); });
  shown.wait_for_ended(1);
  std::this_thread::sleep_for(std::chrono::milliseconds(50));  // now the thread waits for its turn
  progress.advance(7);
  shown.release();
  begun.get();
  ended.get();
  ASSERT_TRUE(store.progress());
  EXPECT_EQ(store.progress()->done, 7u);
}

}  // namespace
}  // namespace voxdag
