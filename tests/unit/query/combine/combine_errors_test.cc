// Damaged files, full disks and interruptions give an error. No output and no temporary files
// remain.
#include <algorithm>
#include <optional>

#include "tests/support/error_of.h"
#include "tests/support/faulty_files.h"
#include "tests/support/killed.h"
#include "tests/unit/core/format/color/colored_files.h"
#include "tests/unit/query/combine/combine_fixture.h"

namespace voxdag::query {
namespace {

class CombineErrors : public Combine {
 protected:
  CombineErrors() {
    write_global(path("a"), random_voxels(7, 64));
    write_global(path("b"), random_voxels(8, 64));
  }
  // Replaces a and b by files with colors.
  void use_colored_files() {
    write_colored(path("a"), {6, 6, random_codes(7, 6, 500), smooth_colors(6, 20)});
    write_colored(path("b"), {6, 5, random_codes(8, 6, 500), smooth_colors(5, 20)});
  }
  void check_full_disk();
  void check_killed();
  // Writes the union of a and b, with so little memory that lists of over 256 bytes are in scratch
  // files. Returns the code of the error; nullopt without an error.
  std::optional<ErrorCode> combine_error(FileSystem& files, const CancelToken& cancel) {
    try {
      const auto a = open_global_file(path("a")), b = open_global_file(path("b"));
      CombineSpec spilled = spec(Operation::kUnion, "out");
      spilled.list_bytes = 256;
      spilled.replace = false;
      combine(*a, *b, spilled, files, warnings_, cancel);
    } catch (const Error& error) {
      return error.code();
    }
    return std::nullopt;
  }
};

// A damaged byte in any level of either file, and a truncated checksum table, are detected.
TEST_F(CombineErrors, DamagedInputs) {
  for (const char* name : {"a", "b"}) {
    const std::string intact = bytes(name);
    damage_each_level(name, [&] {
      EXPECT_EQ(combine_error(system_files(), never_), ErrorCode::kCorrupt);
      expect_files({"a", "b"});
    });
    write_bytes(path(name), intact.substr(0, intact.size() - 8));
    EXPECT_EQ(combine_error(system_files(), never_), ErrorCode::kCorrupt);
    write_bytes(path(name), intact);
  }
}

// A file whose levels have wrong words but correct checksums is refused. Tests pointers to the
// middle of a node, to the end of a level and beyond it. Also tests wrong child masks, empty
// bricks, and nodes in a wrong order.
TEST_F(CombineErrors, HostileLevels) {
  const oracle::Dag dag = oracle::build_dag(random_voxels(7, 64), 64);
  const auto intact = level_words(dag);
  const auto write = [&](const std::vector<std::vector<uint32_t>>& levels) {
    GlobalFileWriter writer(system_files(), path("b"), grid_of(64), 64);
    for (uint32_t i = 0; i < levels.size(); ++i) {
      writer.begin_level(4 - i);
      writer.checksum_words(levels[i]);
      writer.write_words(0, levels[i]);
      writer.end_level({i == 0 ? dag.bricks.size() : dag.levels[i - 1].size(), levels[i].size()});
    }
    writer.finish({dag.voxels, dag.svo_nodes});
  };
  write(intact);
  EXPECT_EQ(combine_error(system_files(), never_), std::nullopt);
  std::filesystem::remove(path("out"));
  for (size_t i = 0; i < intact.size(); ++i)
    for (const uint32_t wrong : {0u, 1u, static_cast<uint32_t>(intact[i].size() - 1), ~0u})
      for (const size_t at : {size_t{1}, intact[i].size() / 2}) {
        auto levels = intact;
        if (levels[i][at] == wrong) continue;
        levels[i][at] = wrong;
        write(levels);
        SCOPED_TRACE(testing::Message() << i << " " << at << " " << wrong);
        const auto error = combine_error(system_files(), never_);
        // No error is also possible, because the changed word can give another valid DAG.
        EXPECT_EQ(error.value_or(ErrorCode::kCorrupt), ErrorCode::kCorrupt);
        if (!error) std::filesystem::remove(path("out"));
        expect_files({"a", "b"});
      }
}

// If the disk is full from the n-th write on, combine() fails with kNoSpace.
void CombineErrors::check_full_disk() {
  uint64_t failed = 0;
  for (uint64_t at = 1;; at += 1 + at / 4) {
    SCOPED_TRACE(at);
    crash::FaultyFiles files({crash::Fault::kNoSpace, at});
    const auto error = combine_error(files, never_);
    if (!error) break;
    EXPECT_EQ(error, ErrorCode::kNoSpace);
    expect_files({"a", "b"});
    ++failed;
  }
  EXPECT_GT(failed, 5u);
  std::filesystem::remove(path("out"));
}

TEST_F(CombineErrors, FullDisk) {
  check_full_disk();
  use_colored_files();
  check_full_disk();
}

// If the n-th read of a temporary file or of the output fails, combine() fails with kIo.
TEST_F(CombineErrors, FailingReads) {
  uint64_t failed = 0;
  for (uint64_t at = 1;; at += 1 + at / 4) {
    SCOPED_TRACE(at);
    crash::FaultyFiles files({crash::Fault::kReadError, at});
    const auto error = combine_error(files, never_);
    if (!error) break;
    EXPECT_EQ(error, ErrorCode::kIo);
    expect_files({"a", "b"});
    ++failed;
  }
  EXPECT_GT(failed, 5u);
}

// The process is killed after each of many operations. The same command then succeeds, and removes
// the temporary files of the killed process. If the killed process had already finished its output,
// the command refuses to replace it.
void CombineErrors::check_killed() {
  combine_error(system_files(), never_);
  const std::string clean = bytes("out");
  std::filesystem::remove(path("out"));
  uint64_t repeated = 0;
  for (uint64_t kill_after = 1;; kill_after += 1 + kill_after / 4) {
    SCOPED_TRACE(kill_after);
    if (!is_killed([&] {
          crash::FaultyFiles files({crash::Fault::kKillAfter, kill_after});
          combine_error(files, never_);
        }))
      break;
    const auto error = combine_error(system_files(), never_);
    const bool was_written = error == ErrorCode::kInvalidInput;
    EXPECT_TRUE(!error || was_written);
    repeated += !was_written;
    EXPECT_TRUE(bytes("out") == clean);
    expect_files({"a", "b", "out"});
    std::filesystem::remove(path("out"));
  }
  EXPECT_GT(repeated, 5u);
  std::filesystem::remove(path("out"));
}

TEST_F(CombineErrors, Killed) {
  check_killed();
  use_colored_files();
  check_killed();
}

TEST_F(CombineErrors, Canceled) {
  CancelToken canceled;
  canceled.cancel();
  EXPECT_EQ(combine_error(system_files(), canceled), ErrorCode::kCanceled);
  expect_files({"a", "b"});
}

}  // namespace
}  // namespace voxdag::query
