// Tests the simulated device: it finds the violation in programs that break one rule each, and
// accepts sound programs.
#include <gtest/gtest.h>

#include "tests/cuda_sim/rules/programs.h"
#include "tests/cuda_sim/sim/faults.h"
#include "tests/cuda_sim/sim/schedule.h"

namespace voxdag::cuda_sim {
namespace {

TEST(SimulatedDevice, EndsProgramsThatBreakARule) {
  testing::GTEST_FLAG(death_test_style) = "fast";
  set_schedule({true, 1});
  for (const BrokenProgram& program : broken_programs())
    EXPECT_DEATH(program.run(), std::string("cuda_sim: .*") + program.violation) << program.name;
}

// The simulation also detects an access of the host in code that is not instrumented, such as this
// test.
TEST(SimulatedDevice, EndsAHostThatTouchesDeviceMemory) {
  testing::GTEST_FLAG(death_test_style) = "fast";
  EXPECT_DEATH(static_cast<void>(words_of_the_device()[0]), "the host touched device memory");
}

TEST(SimulatedDevice, LetsSoundProgramsPass) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    set_schedule({seed % 2 == 0, seed});
    const auto read = exchange_with_neighbors(8, 128);
    for (size_t i = 0; i < read.size(); ++i) ASSERT_EQ(read[i], (i % 128 + 1) % 128) << seed;
  }
  EXPECT_EQ(bytes_in_use(), 0u);
}

TEST(SimulatedDevice, ADownloadIsJunkUntilItIsWaitedFor) {
  set_schedule({true, 1});
  const DownloadedWord word = download_word(5);
  EXPECT_NE(word.before, 5u);
  EXPECT_EQ(word.after, 5u);
}

TEST(SimulatedDevice, CountsWhatIsNotReleased) {
  EXPECT_EQ(forget_an_allocation(), 100u);
  EXPECT_EQ(bytes_in_use(), 0u);
}

// After upload() has returned, its source may change or be released.
TEST(SimulatedDevice, UploadsAreWaitedFor) {
  set_schedule({true, 1});
  EXPECT_EQ(upload_then_change(0x0123456789abcdef), 0x0123456789abcdefu);
}

}  // namespace
}  // namespace voxdag::cuda_sim
