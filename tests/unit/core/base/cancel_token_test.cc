#include "voxdag/cancel_token.h"

#include <gtest/gtest.h>

#include <thread>

namespace voxdag {
namespace {

// A token has no effect until it is set. Then every check throws kCanceled.
TEST(CancelToken, ThrowsOnceSet) {
  CancelToken token;
  EXPECT_FALSE(token.canceled());
  EXPECT_NO_THROW(token.check());
  token.cancel();
  for (int i = 0; i < 2; ++i) {
    EXPECT_TRUE(token.canceled());
    try {
      token.check();
      FAIL() << "check() returned";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCanceled);
    }
  }
}

// A loop on one thread ends after another thread has called cancel().
TEST(CancelToken, IsSeenByOtherThreads) {
  CancelToken token;
  bool stopped = false;
  std::thread worker([&] {
    try {
      for (;;) token.check();
    } catch (const Error&) {
      stopped = true;
    }
  });
  token.cancel();
  worker.join();
  EXPECT_TRUE(stopped);
}

}  // namespace
}  // namespace voxdag
