// Short of memory: a build under a small budget, in a process that gets only a little more address
// space than that, ends with the bytes of a build that has plenty.
#include <sys/resource.h>

#include <fstream>

#include "tests/crash/crash_fixture.h"

namespace crash {
namespace {

// Memory of a process in addition to its budget: code, stacks, the allocator's reserves, SQLite.
constexpr uint64_t kBesides = uint64_t{1} << 30;

// A sanitizer's shadow alone takes more than any limit worth testing.
bool under_a_sanitizer() {
  uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages > (uint64_t{1} << 40) / 4096;
}

class MemoryTest : public CrashTest {};

// Slivers that cross the whole grid: the crowded case, in which subvolumes outgrow their share.
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
