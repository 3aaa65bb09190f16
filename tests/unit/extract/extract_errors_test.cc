// Damaged files, full disks and interruptions: an error, no output, and nothing left behind.
#include <filesystem>
#include <optional>

#include "tests/crash/faulty_files.h"
#include "tests/unit/base/error_of.h"
#include "tests/unit/extract/extract_fixture.h"

namespace voxdag::query {
namespace {

class ExtractErrors : public Extract {
 protected:
  ExtractErrors() { write_global(path("in.vdag"), random_voxels(7, 64)); }
  // The error of an extraction of the whole grid; nullopt if there was none.
  std::optional<ErrorCode> error_with(FileSystem& files, Progress& progress,
                                      const CancelToken& cancel) {
    try {
      const auto file = open_global_file(path("in.vdag"));
      extract(*file, spec("out.vdag", {6, whole_grid(6)}), files, progress, cancel);
    } catch (const Error& error) {
      return error.code();
    }
    return std::nullopt;
  }
};

// Any damaged byte of the levels or of the checksum table is found where it is read.
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

// Offsets that lead nowhere are refused, though every checksum is right.
TEST_F(ExtractErrors, OffsetsThatLeadNowhere) {
  oracle::Voxels voxels(16);
  voxels.set(1, 2, 3);
  const oracle::Dag dag = oracle::build_dag(voxels, 64);
  for (const uint32_t wrong : {1u, 2u, 40u}) {
    auto levels = level_words(dag);
    levels[1][1] = wrong;  // from the node above the only brick
    GlobalFileWriter writer(system_files(), path("in.vdag"), grid_of(16), 64);
    for (uint32_t i = 0; i < levels.size(); ++i) {
      writer.begin_level(2 - i);
      writer.checksum_words(levels[i]);
      writer.write_words(0, levels[i]);
      writer.end_level({1, levels[i].size()});
    }
    writer.finish({dag.voxels, dag.svo_nodes});
    const auto file = open_global_file(path("in.vdag"));
    for (const uint32_t grid_levels : {3u, 4u})
      EXPECT_EQ(error_of([&] {
                  extract(*file, spec("out.vdag", {grid_levels, whole_grid(grid_levels)}),
                          system_files(), warnings_, never_);
                }).code(),
                ErrorCode::kCorrupt)
          << wrong;
    expect_files({"in.vdag"});
  }
}

// A disk that is full from any write on.
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

// Reads that fail, of the input or of temporary files.
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

// Cancels when a stage begins.
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

// Two at a time do not write to the same file.
TEST_F(ExtractErrors, OutputInUse) {
  const auto lock = system_files().try_lock(path("out.vdag.lock"));
  EXPECT_EQ(error_with(system_files(), warnings_, never_), ErrorCode::kIo);
  expect_files({"in.vdag", "out.vdag.lock"});
}

}  // namespace
}  // namespace voxdag::query
