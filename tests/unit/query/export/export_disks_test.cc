// Kills exports, and exports to full disks. A file with a final name is always complete, and
// temporary files of a killed export do not prevent the next export.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "core/base/error.h"
#include "core/format/global/open_global.h"
#include "query/export/export.h"
#include "tests/support/error_of.h"
#include "tests/support/faulty_files.h"
#include "tests/support/killed.h"
#include "tests/unit/core/format/test_files.h"
#include "tests/unit/query/export/corners.h"

namespace voxdag::query {
namespace {

constexpr uint32_t kDiskLevels = 10;

class ExportDisks : public testing::TestWithParam<std::string> {
 protected:
  ExportDisks() {
    write_corners(folder_.file("a.vdag"), kDiskLevels);
    file_ = open_global_file(folder_.file("a.vdag"));
  }
  void run(FileSystem& files, const std::string& name, bool replace = false) {
    NoProgress progress;
    ExportRequest request{
        &format(), {kDiskLevels, whole_grid(kDiskLevels)}, output(name), 64 << 20};
    request.replace = replace;
    export_dag(files, *file_, request, progress, CancelToken{});
  }
  const ExportFormat& format() const { return export_format(GetParam()); }
  std::string output(const std::string& name) const {
    return folder_.file(name + (format().suffix ? format().suffix : ".x"));
  }
  std::vector<std::string> paths(const std::string& name) const {
    return export_paths(format(), output(name));
  }
  // Returns the bytes of all files that the export `name` wrote, and removes these files.
  std::vector<std::string> take(const std::string& name) {
    std::vector<std::string> bytes;
    for (const std::string& path : paths(name)) {
      bytes.push_back(read_bytes(path));
      system_files().remove(path);
    }
    return bytes;
  }
  void expect_only_the_input() {
    EXPECT_EQ(system_files().list(folder_.path()).size(), 1u) << "only the input is there";
  }
  TemporaryFolder folder_;
  std::unique_ptr<voxdag_reader::File> file_;
};
using ExportKilled = ExportDisks;
using ExportTruncated = ExportDisks;

// After a kill, the same command succeeds. If the killed command had already completed a file, the
// command refuses to replace this file without --force.
TEST_P(ExportKilled, IsRepeatedByTheSameCommand) {
  run(system_files(), "clean");
  const std::vector<std::string> clean = take("clean");
  uint64_t kills = 0, repeated = 0;
  for (;; ++kills) {
    SCOPED_TRACE(kills);
    const crash::FaultPlan plan{crash::Fault::kKillAfter, kills + 1};
    if (!is_killed([&] {
          crash::FaultyFiles files(plan);
          run(files, "out");
        }))
      break;
    const bool is_written = std::ranges::any_of(
        paths("out"), [&](const std::string& path) { return system_files().exists(path); });
    if (is_written)
      EXPECT_EQ(error_of([&] { run(system_files(), "out"); }).code(), ErrorCode::kInvalidInput);
    else
      ++repeated;
    run(system_files(), "out", is_written);
    EXPECT_EQ(take("out"), clean);
    expect_only_the_input();
  }
  EXPECT_GT(kills, 5u);
  EXPECT_GT(repeated, 2u);
  take("out");
}

// Two exports never write to the same file concurrently.
TEST_P(ExportKilled, IsNotConfusedWithARunningOne) {
  const auto held = system_files().try_lock(output("out") + ".lock");
  EXPECT_EQ(error_of([&] { run(system_files(), "out", true); }).code(), ErrorCode::kIo);
  EXPECT_EQ(system_files().list(folder_.path()).size(), 2u);
}

// A killed export leaves a partial file and an empty lock file. A partial file without a lock file,
// or with a lock file that has contents, belongs to another program, so the export keeps it.
TEST_P(ExportKilled, ButTheFilesOfOthersStay) {
  const std::string partial = output("out") + ".partial", lock = output("out") + ".lock";
  for (const bool has_lock : {false, true}) {
    SCOPED_TRACE(has_lock);
    write_bytes(partial, "mine");
    if (has_lock) write_bytes(lock, "mine, too");
    const Error error = error_of([&] { run(system_files(), "out"); });
    EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
    EXPECT_EQ(error.message(),
              partial + " exists: expected another output, or --force to replace it");
    EXPECT_EQ(read_bytes(partial), "mine");
    EXPECT_EQ(system_files().list(folder_.path()).size(), has_lock ? 3u : 2u);
  }
}

// All writes from the n-th on fail as on a full disk. The export fails with kNoSpace, even if the
// format's library reports a different error.
TEST_P(ExportDisks, Full) {
  uint64_t failed = 0;
  for (;; ++failed) {
    SCOPED_TRACE(failed);
    crash::FaultyFiles files({crash::Fault::kNoSpace, failed + 1});
    try {
      run(files, "out");
      break;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kNoSpace) << error.message();
    }
    expect_only_the_input();
  }
  EXPECT_GE(failed, 2u);
  take("out");
}

// A disk with 100 free bytes. An export must notice this before it creates a file.
class NoSpace : public ForwardingFiles {
 public:
  NoSpace() : ForwardingFiles(system_files()) {}
  uint64_t free_space(const std::string&) override { return 100; }
  std::unique_ptr<WritableFile> create(const std::string& path) override {
    ADD_FAILURE() << path << " was made";
    return ForwardingFiles::create(path);
  }
};

TEST_P(ExportDisks, SpaceIsAskedForFirst) {
  NoSpace files;
  const Error error = error_of([&] { run(files, "out"); });
  EXPECT_EQ(error.code(), ErrorCode::kNoSpace) << error.message();
  expect_only_the_input();
}

std::string name_of(const testing::TestParamInfo<std::string>& format) { return format.param; }

std::vector<std::string> all_formats() {
  std::vector<std::string> names;
  for (const ExportFormat& format : export_formats()) names.emplace_back(format.name);
  return names;
}
INSTANTIATE_TEST_SUITE_P(Formats, ExportDisks, testing::ValuesIn(all_formats()), name_of);

// Truncates the input file at the moment when the export creates its output.
class Truncating : public ForwardingFiles {
 public:
  explicit Truncating(const std::string& input) : ForwardingFiles(system_files()), input_(input) {}
  std::unique_ptr<WritableFile> create(const std::string& path) override {
    std::filesystem::resize_file(input_, 4096);
    return ForwardingFiles::create(path);
  }

 private:
  const std::string input_;
};

// If the input, which is mapped, is truncated during an export, the export fails with an error, and
// no signal ends the process.
TEST_P(ExportTruncated, IsAnError) {
  Truncating files(folder_.file("a.vdag"));
  const Error error = error_of([&] { run(files, "out"); });
  EXPECT_EQ(error.code(), ErrorCode::kIo);
  EXPECT_EQ(error.message(),
            folder_.file("a.vdag") +
                ": it became shorter, or its disk failed, while it was read: expected a "
                "file that does not change");
  expect_only_the_input();
}

// Exports of these formats read the input after they have created the output.
INSTANTIATE_TEST_SUITE_P(Formats, ExportTruncated,
                         testing::Values("hashdag", "svdag", "voxel", "vox", "bt", "ot", "ply",
                                         "npz", "vtu", "inp"),
                         name_of);

INSTANTIATE_TEST_SUITE_P(Formats, ExportKilled, testing::Values("hashdag", "ply"), name_of);

}  // namespace
}  // namespace voxdag::query
