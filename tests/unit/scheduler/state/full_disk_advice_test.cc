#include "scheduler/state/full_disk_advice.h"

#include <gtest/gtest.h>

#include <vector>

namespace voxdag {
namespace {

constexpr Audience kTestUsers{&spell_as_member, "retry the job"};

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
  set_audience(kTestUsers);
  const std::string advice = full_disk_advice(half_built(), true);
  set_audience(kCommandLineUsers);
  EXPECT_EQ(
      advice,
      "; the finished work is kept: free the space for colors (a plan estimates it) and about "
      "3.00 MiB of disk space and retry the job");
}

}  // namespace
}  // namespace voxdag
