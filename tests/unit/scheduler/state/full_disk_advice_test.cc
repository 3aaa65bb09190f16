#include "scheduler/state/full_disk_advice.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "tests/support/audience_guard.h"

namespace voxdag {
namespace {

std::vector<StoredSubvolume> half_built() {
  std::vector<StoredSubvolume> subvolumes(2);
  for (StoredSubvolume& subvolume : subvolumes) subvolume.weight = 1;
  subvolumes[0].state = SubvolumeState::kBuilt;
  subvolumes[0].artifact.bytes = 1 << 20;
  return subvolumes;
}

// 1 MiB of artifacts is written. 1 MiB of artifacts and a global file of 2 MiB are missing.
TEST(FullDiskAdviceTest, EstimatesTheMissingSpace) {
  EXPECT_EQ(full_disk_advice(half_built(), false),
            "; the finished work is kept: free about 3.00 MiB of disk space and run the same "
            "command again");
  EXPECT_EQ(full_disk_advice({}, true),
            "; the finished work is kept: free disk space and run the same command again");
}

TEST(FullDiskAdviceTest, SaysHowTheUsersOfTheProcessResume) {
  const auto advice = [](const Audience& audience) {
    const test::AudienceGuard guard(audience);
    return full_disk_advice(half_built(), true);
  };
  const auto expected = [](const std::string& plan, const std::string& repeat) {
    return "; the finished work is kept: free the space for colors (" + plan +
           " estimates it) and about 3.00 MiB of disk space and " + repeat;
  };
  EXPECT_EQ(advice(kCommandLineUsers), expected("voxdag plan", "run the same command again"));
  EXPECT_EQ(advice(kPythonUsers), expected("voxdag.plan()", "make the same call again"));
  EXPECT_EQ(advice(test::kOtherUsers), expected("a plan", "try again"));
}

}  // namespace
}  // namespace voxdag
