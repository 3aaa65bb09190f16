// verify_global_file() with so little memory that the levels are in scratch files. verify_test.cc
// and the tests of `reorder` compare the results with those of the verification in memory.
#include <gmock/gmock.h>

#include "core/format/global/node_index.h"
#include "core/format/global/page_limit.h"
#include "tests/support/faulty_files.h"
#include "tests/unit/core/format/test_files.h"
#include "tests/unit/core/format/verify_both_ways.h"

namespace voxdag {
namespace {

using testing::HasSubstr;

class VerifyWindows : public testing::Test {
 protected:
  static constexpr int kEdge = 64;
  static constexpr uint32_t kBrickLevel = 4;

  VerifyWindows() { write_global(path_, dag_, grid_of(kEdge)); }

  uint64_t scratch_bytes(uint64_t memory_bytes) const {
    return verify_in_windows(*open_global_file(path_), {}, memory_bytes);
  }

  TemporaryFolder folder_;
  const std::string path_ = folder_.file("scene.vdag");
  const oracle::Dag dag_ = oracle::build_dag(noise_voxels(9, kEdge, 6000), 64);
};

TEST_F(VerifyWindows, MoreMemoryWritesLess) {
  const auto file = open_global_file(path_);
  ASSERT_GT(file->level(kBrickLevel).word_count, 16 * span_words_of(*file));  // 16 windows
  const uint64_t all = scratch_bytes(0), some = scratch_bytes(20000);
  // Values of all nodes, and of the children for each pointer.
  EXPECT_GT(all, 12 * file->dag_nodes() + 16 * file->level(kBrickLevel).node_count);
  EXPECT_LT(some, all);
  EXPECT_GT(some, 0u);
  EXPECT_EQ(scratch_bytes(UINT64_MAX), 0u);
}

// The last pointer of a level leads to no node.
TEST_F(VerifyWindows, TheLastPointerIsNamed) {
  const auto level = open_global_file(path_)->level(kBrickLevel - 1);
  const uint64_t last = level.word_count - 1;
  const auto bricks = static_cast<uint32_t>(open_global_file(path_)->level(kBrickLevel).word_count);
  for (const uint32_t pointer : {bricks - 1, bricks, ~uint32_t{0}}) {
    auto levels = level_words(dag_);
    levels[1][last] = pointer;
    GlobalFileWriter writer(system_files(), path_, grid_of(kEdge), 64);
    for (uint32_t l = kBrickLevel + 1; l-- > 0;) {
      const std::vector<uint32_t>& words = levels[kBrickLevel - l];
      writer.begin_level(l);
      writer.checksum_words(words);
      writer.write_words(0, words);
      writer.end_level(
          {l == kBrickLevel ? dag_.bricks.size() : dag_.levels[kBrickLevel - 1 - l].size(),
           words.size()});
    }
    writer.finish({dag_.voxels, dag_.svo_nodes});
    EXPECT_THAT(error_of([&] { verify_both_ways(*open_global_file(path_)); }).message(),
                HasSubstr("level 3, word " + std::to_string(last) + ": a child at word " +
                          std::to_string(pointer) + ", where no node of level 4 begins"));
  }
}

TEST_F(VerifyWindows, FullDisk) {
  uint64_t failed = 0;
  for (uint64_t at = 1;; at += 1 + at / 4) {
    SCOPED_TRACE(at);
    crash::FaultyFiles files({crash::Fault::kNoSpace, at});
    try {
      verify_in_windows(*open_global_file(path_), {}, 0, files);
      break;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kNoSpace) << error.message();
    }
    ++failed;
  }
  EXPECT_GT(failed, 10u);
}

// A disk without enough space is refused before anything is written.
TEST_F(VerifyWindows, TooLittleSpaceIsRefused) {
  struct SmallDisk : ForwardingFiles {
    using ForwardingFiles::ForwardingFiles;
    uint64_t free_space(const std::string&) override { return 100; }
  } files(system_files());
  const Error error = error_of([&] { verify_in_windows(*open_global_file(path_), {}, 0, files); });
  EXPECT_EQ(error.code(), ErrorCode::kNoSpace);
  EXPECT_THAT(error.message(), HasSubstr("level 4: the temporary files need "));
  EXPECT_THAT(error.message(), HasSubstr(" has only 100 B free: expected more free space"));
}

// A wrong bit that the disk returns is an error of the scratch file, not of the .vdag file.
TEST_F(VerifyWindows, DamagedScratchFilesAreNamed) {
  uint64_t found = 0;
  for (uint64_t at = 1;; ++at) {
    SCOPED_TRACE(at);
    crash::FaultyFiles files({crash::Fault::kFlipBit, at});
    try {
      verify_in_windows(*open_global_file(path_), {1}, 0, files);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
      EXPECT_THAT(error.message(), HasSubstr("/tables: the bytes from "));
      ++found;
    }
    if (files.operations() < at) break;
    at += at / 16;
  }
  EXPECT_GT(found, 30u);
}

// Cancels when the n-th file is created.
TEST_F(VerifyWindows, Cancel) {
  struct CancelingFiles : crash::FaultyFiles {
    CancelingFiles(CancelToken& token, uint64_t after)
        : FaultyFiles({}), cancel(token), last(after) {}
    std::unique_ptr<WritableFile> create(const std::string& path) override {
      if (created++ == last) cancel.cancel();
      return FaultyFiles::create(path);
    }
    CancelToken& cancel;
    const uint64_t last;
    uint64_t created = 0;
  };
  uint64_t canceled = 0;
  for (uint64_t after = 0;; ++after) {
    SCOPED_TRACE(after);
    CancelToken cancel;
    CancelingFiles files(cancel, after);
    try {
      verify_in_windows(*open_global_file(path_), {}, 0, files, cancel);
      break;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kCanceled) << error.message();
    }
    ++canceled;
  }
  EXPECT_GT(canceled, 8u);
}

// Another program makes the nodes of a level longer after the level was divided into spans. The
// index of a window then only has nodes that begin in their spans.
TEST_F(VerifyWindows, ALevelThatChanges) {
  constexpr uint64_t kSpanWords = 64;
  std::vector<uint32_t> words(64 * kSpanWords, 1);  // nodes with one child
  voxdag_reader::Level level;
  level.words = words.data();
  level.word_count = words.size();
  level.node_count = words.size() / 2;
  const auto file = open_global_file(path_);
  PageLimit pages(*file, UINT64_MAX);
  MemoryBudget budget(UINT64_MAX);
  const NodeSpans spans(level, Pointers::kNarrow, 1, budget, {}, "level", &pages, kSpanWords);
  std::fill(words.begin(), words.end(), 255);  // nodes of nine words
  const NodeIndex window(spans, 0, 2, 1, budget, pages);
  for (uint64_t at = 0; at < 2 * kSpanWords; ++at)
    EXPECT_EQ(window.find(at) != NodeIndex::kNone, at % kSpanWords % 9 == 0) << at;
}

}  // namespace
}  // namespace voxdag
