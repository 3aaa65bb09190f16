// Another program writes files to the shared folder of a cluster build that look like results of
// its tasks. The build rejects them with a warning, and continues.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "core/base/process_limits.h"
#include "scheduler/slurm/files/cluster_state.h"
#include "scheduler/slurm/files/completion_record.h"
#include "tests/unit/scheduler/slurm/played_slurm.h"

namespace voxdag {
namespace {

class SharedFolder : public Cluster {
 protected:
  std::string cluster(const std::string& name) const { return output() + ".work/cluster/" + name; }
  // Builds with two batches (each batch is the subvolumes of one Slurm task). Before the task of
  // batch 1 runs, calls disturb(path), which creates the file `name` in the cluster folder. Expects
  // that the result is right, and that a warning reports that `name` was rejected and contains
  // `warning`.
  void expect_rejected(const std::string& name, const std::string& warning,
                       const std::function<void(const std::string& path)>& disturb) {
    SCOPED_TRACE(name);
    warnings_.text.clear();
    bool is_done = false;
    slurm_.before_task = [&](uint32_t batch) {
      if (batch == 1 && !std::exchange(is_done, true)) disturb(cluster(name));
    };
    EXPECT_EQ(build(spec(2)).cluster->batches, 2u);
    EXPECT_NE(warnings_.text.find(name + " is rejected: "), std::string::npos) << warnings_.text;
    EXPECT_NE(warnings_.text.find(warning), std::string::npos) << warnings_.text;
  }
  // Returns a false completion record for batch 1, which is not built yet: all its subvolumes are
  // empty.
  CompletionRecord empty_record() {
    ClusterState state = *read_cluster_state(system_files(), output() + ".work");
    CompletionRecord record;
    record.program = state.program;
    record.build = state.build;
    record.batch = 1;
    record.attempt = "+";
    for (const ExpectedSubvolume& subvolume : state.find(1)->subvolumes)
      record.subvolumes.push_back({subvolume.id, {}});
    return record;
  }
};

TEST_F(SharedFolder, ThingsThatAreNoRecords) {
  const auto link_to = [](const std::string& target) {
    return [=](const std::string& path) { std::filesystem::create_symlink(target, path); };
  };
  const std::string name = "batch-1.record-+.json";
  expect_rejected(name, "not a regular file",
                  [](const std::string& path) { ASSERT_EQ(mkfifo(path.c_str(), 0600), 0); });
  expect_rejected(name, "not a regular file",
                  [](const std::string& path) { std::filesystem::create_directory(path); });
  expect_rejected(name, "symbolic link", link_to("/tmp"));
  expect_rejected(name, "symbolic link", link_to("/dev/zero"));
}

TEST_F(SharedFolder, ALargeRecordIsNotRead) {
  const uint64_t before = peak_resident_bytes();
  expect_rejected("batch-1.record-+.json", "expected at most", [](const std::string& path) {
    std::ofstream(path, std::ios::binary) << "{";
    std::filesystem::resize_file(path, uint64_t{1} << 30);
  });
  EXPECT_LT(peak_resident_bytes(), before + (uint64_t{300} << 20));
}

TEST_F(SharedFolder, ARecordThatContradictsTheBatch) {
  expect_rejected("batch-1.record-+.json", "it has 0 voxels for the ",
                  [this](const std::string& path) {
                    write_file_atomically(system_files(), path, encode_record(empty_record()));
                  });
}

TEST_F(SharedFolder, FailuresOfOthersDoNotCount) {
  slurm_.before_task = [&](uint32_t batch) {
    if (batch != 1 || !slurm_.before_task) return;
    ASSERT_EQ(mkfifo(cluster("batch-1.failure-+.json").c_str(), 0600), 0);
    std::filesystem::create_directory(cluster("batch-1.failure--.json"));
    slurm_.before_task = nullptr;
  };
  EXPECT_EQ(build(spec(2)).cluster->batches, 2u);
  EXPECT_EQ(warnings_.text, "");
}

}  // namespace
}  // namespace voxdag
