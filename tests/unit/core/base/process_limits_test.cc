#include "core/base/process_limits.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/support/temporary_folder.h"

namespace voxdag {
namespace {

class CgroupTest : public testing::Test {
 protected:
  void write(const std::string& path, const std::string& text) {
    const std::string full = mount() + "/" + path;
    std::filesystem::create_directories(std::filesystem::path(full).parent_path());
    std::ofstream(full) << text;
  }
  std::string mount() const { return folder_.file("cgroup"); }

  TemporaryFolder folder_;
};

// In cgroup version 2, the limit is the lowest of the process's group and its ancestors. Siblings
// do not count.
TEST_F(CgroupTest, WalksUpInVersion2) {
  write("slice/box/memory.max", "max\n");
  write("slice/memory.max", "3000000000\n");
  write("slice/other/memory.max", "1000\n");
  EXPECT_EQ(cgroup_memory("0::/slice/box\n", mount()), 3000000000u);
  write("slice/box/memory.max", "2000000000\n");
  EXPECT_EQ(cgroup_memory("0::/slice/box\n", mount()), 2000000000u);
  // In a container, the path of the process's group can be "/", or a path that the container cannot
  // see. Then the limit of the mounted root applies.
  EXPECT_EQ(cgroup_memory("0::/\n", mount()), UINT64_MAX);
  write("memory.max", "500000000\n");
  EXPECT_EQ(cgroup_memory("0::/\n", mount()), 500000000u);
  EXPECT_EQ(cgroup_memory("0::/not/there\n", mount()), 500000000u);
}

// A CPU quota is rounded up to complete CPUs. The lowest quota of the group and its ancestors
// counts.
TEST_F(CgroupTest, CpuQuotas) {
  write("slice/box/cpu.max", "max 100000\n");
  EXPECT_EQ(cgroup_cpus("0::/slice/box\n", mount()), UINT64_MAX);
  write("slice/cpu.max", "250000 100000\n");
  EXPECT_EQ(cgroup_cpus("0::/slice/box\n", mount()), 3u);
  write("slice/box/cpu.max", "1000 100000\n");
  EXPECT_EQ(cgroup_cpus("0::/slice/box\n", mount()), 1u);
  EXPECT_EQ(cgroup_cpus("", mount()), UINT64_MAX);
  // In cgroup version 1, two controllers can be mounted in one folder.
  write("cpu,cpuacct/pool/cpu.cfs_quota_us", "-1\n");
  write("cpu,cpuacct/pool/cpu.cfs_period_us", "100000\n");
  EXPECT_EQ(cgroup_cpus("4:cpu,cpuacct:/pool\n", mount()), UINT64_MAX);
  write("cpu,cpuacct/pool/cpu.cfs_quota_us", "400000\n");
  EXPECT_EQ(cgroup_cpus("4:cpu,cpuacct:/pool\n", mount()), 4u);
  EXPECT_EQ(cgroup_cpus("4:cpuset:/pool\n", mount()), UINT64_MAX);
  EXPECT_GE(default_threads(), 1u);
}

// The limits of cgroup version 1 are found, alone or together with version 2. A text that does not
// describe a membership gives no limit.
TEST_F(CgroupTest, WalksUpInVersion1) {
  write("memory/pool/job/memory.limit_in_bytes", "9223372036854771712\n");
  write("memory/pool/memory.limit_in_bytes", "700000000\n");
  const std::string membership = "9:name=systemd:/\n4:cpu,memory:/pool/job\n1:cpu:/x\n0::/\n";
  EXPECT_EQ(cgroup_memory(membership, mount()), 700000000u);
  EXPECT_EQ(cgroup_memory("4:memory:/pool\n", mount()), 700000000u);
  EXPECT_EQ(cgroup_memory("4:cpuset:/pool\n", mount()), UINT64_MAX);
  EXPECT_EQ(cgroup_memory("no line of ours\n", mount()), UINT64_MAX);
  EXPECT_EQ(cgroup_memory("", mount()), UINT64_MAX);
}

}  // namespace
}  // namespace voxdag
