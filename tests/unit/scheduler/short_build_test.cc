// Builds that end before their first checkpoint is due make few system calls.
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "scheduler/run_build.h"
#include "scheduler/spec/build_report.h"
#include "tests/support/temporary_folder.h"
#include "tests/unit/scheduler/metered_files.h"
#include "tests/unit/scheduler/spheres_build.h"

namespace voxdag {
namespace {

class ShortBuildTest : public testing::Test {
 protected:
  void SetUp() override {
    write_spheres(scene(), 20000);
    BuildSpec spec = spheres_build(scene(), output());
    spec.run.checkpoint_interval_s = 1e9;
    spec.run.threads = 2;
    NoProgress progress;
    CancelToken cancel;
    run_build(spec, {files_, progress, cancel});
  }
  std::string scene() const { return folder_.path() + "/scene.glb"; }
  std::string output() const { return folder_.path() + "/out.vdag"; }

  TemporaryFolder folder_;
  MeteredFiles files_;
};

// The synced files are the output, the report and the folder that contains them. There is no job
// store.
TEST_F(ShortBuildTest, SyncsOnlyItsResults) {
  const std::string report = default_report_path(output()) + ".partial";
  EXPECT_EQ(files_.syncs,
            (std::map<std::string, uint64_t>{{output() + ".partial", 1}, {report, 1}}));
  EXPECT_EQ(files_.directory_syncs, (std::map<std::string, uint64_t>{{folder_.path(), 1}}));
}

// A system call for each range that the build reads or writes would take longer than the build.
TEST_F(ShortBuildTest, ReadsAndWritesInFewSteps) {
  EXPECT_EQ(files_.reads.at(scene()), 1u);
  size_t segments = 0;
  for (const auto& [path, reads] : files_.reads) {
    if (!path.ends_with(".vdseg")) continue;
    ++segments;
    EXPECT_EQ(reads, 1u) << path;
    EXPECT_LE(files_.writes.at(path), 2u) << path;
  }
  EXPECT_GE(segments, 1u);
  // The levels in pieces of about 128 KiB, the checksum table, and the header page.
  const std::string partial = output() + ".partial";
  EXPECT_LE(files_.writes.at(partial), 4 + files_.bytes_written.at(partial) / 50'000);
}

}  // namespace
}  // namespace voxdag
