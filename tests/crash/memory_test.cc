// Runs a build with a small budget in a process whose address space is limited to slightly more
// than the budget. The build gives the same bytes as a build with enough memory.
#include <sys/resource.h>

#include <fstream>

#include "tests/crash/crash_fixture.h"

namespace crash {
namespace {

// Address space that a process needs in addition to its budget: code, stacks, the allocator's
// reserves, and SQLite.
constexpr uint64_t kBesides = uint64_t{1} << 30;

// Sanitizers reserve more address space than any useful limit allows.
bool under_a_sanitizer() {
  uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages > (uint64_t{1} << 40) / 4096;
}

class MemoryTest : public CrashTest {};

// The scene consists of slivers that cross the complete grid, so that many subvolumes exceed their
// share of the memory.
TEST_P(MemoryTest, EndsUnderALimitOfAddressSpace) {
  if (under_a_sanitizer()) GTEST_SKIP() << "a sanitizer needs the address space for itself";
  voxdag::GenerateOptions options;
  options.kind = voxdag::SceneKind::kSoup;
  options.triangles = 20000;
  voxdag::NoProgress progress;
  voxdag::CancelToken cancel;
  voxdag::generate_scene(voxdag::system_files(), folder_.file("scene.glb"), options, progress,
                         cancel);
  BuildSpec small = spec();
  small.run.subvolume_edge = 0;
  BuildSpec large = small;
  large.run.memory_bytes = uint64_t{2} << 30;
  const std::string expected = build(large, voxdag::system_files()).sha256;
  std::filesystem::remove(output());

  const pid_t child = fork();
  if (child == 0) {
    const rlimit limit{small.run.memory_bytes + kBesides, small.run.memory_bytes + kBesides};
    if (setrlimit(RLIMIT_AS, &limit) != 0) _exit(2);
    try {
      _exit(build(small, voxdag::system_files()).sha256 == expected ? 0 : 3);
    } catch (const std::exception& error) {
      std::fprintf(stderr, "%s\n", error.what());
      _exit(1);
    }
  }
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
}

INSTANTIATE_TEST_SUITE_P(Ingested, MemoryTest,
                         testing::Values(Ingested::kInMemory, Ingested::kDurable), name_of);

}  // namespace
}  // namespace crash
