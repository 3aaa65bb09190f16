#include "scheduler/cluster/advice_on_tasks.h"

#include <gtest/gtest.h>

#include "tests/support/audience_guard.h"

namespace voxdag {
namespace {

TEST(AdviceOnTasksTest, NamesTheCommandOfEachAudience) {
  EXPECT_EQ(advice_on_tasks(),
            "run the same command again to follow them, or stop them with voxdag stop-tasks");
  {
    const test::AudienceGuard python(kPythonUsers);
    EXPECT_EQ(advice_on_tasks(),
              "make the same call again to follow them, or stop them with the shell command voxdag "
              "stop-tasks");
  }
  const test::AudienceGuard others(test::kOtherUsers);
  EXPECT_EQ(advice_on_tasks(), "try again to follow them");
}

}  // namespace
}  // namespace voxdag
