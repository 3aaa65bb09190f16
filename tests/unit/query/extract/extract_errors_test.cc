// Damaged files, full disks and interruptions give an error. No output and no temporary files
// remain.
#include <algorithm>
#include <filesystem>
#include <optional>

#include "tests/support/error_of.h"
#include "tests/support/faulty_files.h"
#include "tests/support/killed.h"
#include "tests/unit/query/extract/extract_fixture.h"

namespace voxdag::query {
namespace {

class ExtractErrors : public Extract {
 protected:
  ExtractErrors() { write_global(path("in.vdag"), random_voxels(7, 64)); }
  // Extracts the complete grid. Returns the code of the error; nullopt without an error.
  std::optional<ErrorCode> error_with(FileSystem& files, Progress& progress,
                                      const CancelToken& cancel) {
    try {
      const auto file = open_global_file(path("in.vdag"));
      ExtractSpec whole = spec("out.vdag", {6, whole_grid(6)});
      whole.replace = false;
      extract(*file, whole, files, progress, cancel);
    } catch (const Error& error) {
      return error.code();
    }
    return std::nullopt;
  }
};

// A damaged byte in any level or in the checksum table is detected.
TEST_F(ExtractErrors, DamagedInput) {
  const std::string intact = bytes("in.vdag");
  const auto file = open_global_file(path("in.vdag"));
  for (uint32_t l = 0; l <= file->brick_level(); ++l) {
    SCOPED_TRACE(l);
    std::string damaged = intact;
    const size_t at = file->level(l).file_offset + 4 * (file->level(l).word_count / 2);
    damaged[at] = static_cast<char>(damaged[at] ^ 4);
    write_bytes(path("in.vdag"), damaged);
    EXPECT_EQ(error_with(system_files(), warnings_, never_), ErrorCode::kCorrupt);
    expect_files({"in.vdag"});
  }
  std::string damaged = intact;
  damaged.back() = static_cast<char>(damaged.back() ^ 1);
  write_bytes(path("in.vdag"), damaged);
  EXPECT_EQ(error_with(system_files(), warnings_, never_), ErrorCode::kCorrupt);
  expect_files({"in.vdag"});
}

// Offsets that do not lead to a node are refused, even if every checksum is correct.
TEST_F(ExtractErrors, OffsetsThatLeadNowhere) {
  oracle::Voxels voxels(16);
  voxels.set(1, 2, 3);
  const oracle::Dag dag = oracle::build_dag(voxels, 64);
  for (const uint32_t wrong : {1u, 2u, 40u}) {
    auto levels = level_words(dag);
    levels[1][1] = wrong;  // the pointer to the only brick
    GlobalFileWriter writer(system_files(), path("in.vdag"), grid_of(16), 64);
    for (uint32_t i = 0; i < levels.size(); ++i) {
      writer.begin_level(2 - i);
      writer.checksum_words(levels[i]);
      writer.write_words(0, levels[i]);
      writer.end_level({1, levels[i].size()});
    }
    writer.finish({dag.voxels, dag.svo_nodes});
    const auto file = open_global_file(path("in.vdag"));
    for (const uint32_t grid_levels : {2u, 3u, 4u}) {
      ExtractSpec whole = spec("out.vdag", {grid_levels, whole_grid(grid_levels)});
      whole.majority = grid_levels == 2;  // so that the extract also reads the bricks
      EXPECT_EQ(error_of([&] { extract(*file, whole, system_files(), warnings_, never_); }).code(),
                ErrorCode::kCorrupt)
          << wrong;
    }
    expect_files({"in.vdag"});
  }
}

// If the disk is full from the n-th write on, the extract fails with kNoSpace.
TEST_F(ExtractErrors, FullDisk) {
  uint64_t failed = 0;
  for (uint64_t at = 1;; ++at) {
    SCOPED_TRACE(at);
    crash::FaultyFiles files({crash::Fault::kNoSpace, at});
    const auto error = error_with(files, warnings_, never_);
    if (!error) break;
    EXPECT_EQ(error, ErrorCode::kNoSpace);
    expect_files({"in.vdag"});
    ++failed;
  }
  EXPECT_GT(failed, 5u);
}

// If the n-th read of the input or of a temporary file fails, the extract fails with kIo.
TEST_F(ExtractErrors, FailingReads) {
  uint64_t failed = 0;
  for (uint64_t at = 1;; at += 1 + at / 8) {
    SCOPED_TRACE(at);
    crash::FaultyFiles files({crash::Fault::kReadError, at});
    const auto error = error_with(files, warnings_, never_);
    if (!error) break;
    EXPECT_EQ(error, ErrorCode::kIo);
    expect_files({"in.vdag"});
    ++failed;
  }
  EXPECT_GT(failed, 5u);
}

// The process is killed after each of its operations. The same extract then succeeds, and removes
// the temporary files and folders of the killed process, but no files with similar names. If the
// killed process had already finished its output, the extract refuses to replace it.
TEST_F(ExtractErrors, Killed) {
  std::filesystem::create_directory(path("out.vdag.work-"));
  std::filesystem::create_directory(path("out.vdag.work-1234567"));
  error_with(system_files(), warnings_, never_);
  const std::string clean = bytes("out.vdag");
  std::filesystem::remove(path("out.vdag"));
  uint64_t kills = 0, repeated = 0;
  for (;; ++kills) {
    SCOPED_TRACE(kills);
    if (!is_killed([&] {
          crash::FaultyFiles files({crash::Fault::kKillAfter, kills + 1});
          error_with(files, warnings_, never_);
        }))
      break;
    const auto error = error_with(system_files(), warnings_, never_);
    const bool was_written = error == ErrorCode::kInvalidInput;
    EXPECT_TRUE(!error || was_written);
    repeated += !was_written;
    EXPECT_TRUE(bytes("out.vdag") == clean);
    expect_files({"in.vdag", "out.vdag", "out.vdag.work-", "out.vdag.work-1234567"});
    std::filesystem::remove(path("out.vdag"));
  }
  EXPECT_GT(repeated, 5u);
}

// The crop cube of a region around the middle of the grid is the complete grid. The extract then
// warns that it was not cropped, also if the region is the complete grid. The crop cube of a region
// on one side of the middle is smaller, and gives no warning.
TEST_F(ExtractErrors, CropOfNothingIsSaid) {
  const auto is_said = [&](const Region& region, bool crop) {
    warnings_.texts.clear();
    extract_file("in.vdag", spec("out.vdag", {6, region}, crop));
    return std::ranges::any_of(warnings_.texts, [](const std::string& text) {
      return text.ends_with("is the complete grid");
    });
  };
  EXPECT_TRUE(is_said({{31, 0, 0}, {33, 64, 64}}, true));
  EXPECT_FALSE(is_said({{0, 0, 0}, {32, 32, 32}}, true));
  EXPECT_TRUE(is_said(whole_grid(6), true));
  EXPECT_FALSE(is_said(whole_grid(6), false));
  EXPECT_FALSE(is_said({{31, 0, 0}, {33, 64, 64}}, false));
}

// An existing output is replaced only with `replace` (--force), even if an earlier extract wrote
// it.
TEST_F(ExtractErrors, ExistingOutput) {
  ExtractSpec part = spec("out.vdag", {5, whole_grid(5)});
  const auto file = open_global_file(path("in.vdag"));
  extract(*file, part, system_files(), warnings_, never_);
  const std::string before = bytes("out.vdag");
  EXPECT_EQ(error_with(system_files(), warnings_, never_), ErrorCode::kInvalidInput);
  EXPECT_TRUE(bytes("out.vdag") == before);
  part.selection = {6, whole_grid(6)};
  extract(*file, part, system_files(), warnings_, never_);
  EXPECT_TRUE(bytes("out.vdag") == bytes("in.vdag"));
  expect_files({"in.vdag", "out.vdag"});
}

// Cancels when the stage `stage` begins.
class CancelAt : public NoProgress {
 public:
  CancelAt(std::string stage, CancelToken& cancel) : stage_(std::move(stage)), cancel_(cancel) {}
  void begin_stage(std::string_view stage, uint64_t, std::string_view) override {
    if (stage == stage_) cancel_.cancel();
  }

 private:
  const std::string stage_;
  CancelToken& cancel_;
};

TEST_F(ExtractErrors, Canceled) {
  for (const char* stage : {"extract", "merge", "write"}) {
    SCOPED_TRACE(stage);
    CancelToken cancel;
    CancelAt progress(stage, cancel);
    EXPECT_EQ(error_with(system_files(), progress, cancel), ErrorCode::kCanceled);
    expect_files({"in.vdag"});
  }
}

// Two extractions never write to the same file concurrently.
TEST_F(ExtractErrors, OutputInUse) {
  const auto lock = system_files().try_lock(path("out.vdag.lock"));
  EXPECT_EQ(error_with(system_files(), warnings_, never_), ErrorCode::kIo);
  expect_files({"in.vdag", "out.vdag.lock"});
}

}  // namespace
}  // namespace voxdag::query
