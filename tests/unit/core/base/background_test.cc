#include "core/base/background.h"

#include <gtest/gtest.h>

#include <memory>
#include <stdexcept>
#include <thread>

namespace voxdag {
namespace {

// The work runs on another thread. It can own objects that cannot be copied.
TEST(RunInBackground, RunsOnAThreadOfItsOwn) {
  std::thread::id thread;
  std::future<void> done = run_in_background(
      [&, owned = std::make_unique<int>(1)] { thread = std::this_thread::get_id(); });
  done.get();
  EXPECT_NE(thread, std::thread::id());
  EXPECT_NE(thread, std::this_thread::get_id());
}

TEST(RunInBackground, GetThrowsWhatTheWorkThrows) {
  std::future<void> done = run_in_background([] { throw std::runtime_error("failed"); });
  EXPECT_THROW(done.get(), std::runtime_error);
}

}  // namespace
}  // namespace voxdag
