// Tests reorder() with damaged files, full disks and interruptions: it must report an error, and
// leave neither an output nor temporary files.
#include <optional>

#include "query/combine/combine.h"
#include "tests/support/audience_guard.h"
#include "tests/support/error_of.h"
#include "tests/support/faulty_files.h"
#include "tests/support/killed.h"
#include "tests/unit/query/reorder/reorder_fixture.h"

namespace voxdag::query {
namespace {

// The test parameter is the order of the output. The input "a" has the other order.
class ReorderErrors : public Reorder, public testing::WithParamInterface<NodeOrder> {
 protected:
  ReorderErrors() {
    write_global(path("a"), random_voxels(7, 64));
    if (GetParam() == NodeOrder::kByFirstParent) return;
    reorder_file("a", spec(NodeOrder::kByFirstParent, "b"));
    std::filesystem::rename(path("b"), path("a"));
  }
  // Reorders "a" to "out", with so little memory that most data is in scratch files. Returns the
  // code of the error, or nullopt after success.
  std::optional<ErrorCode> reorder_error(FileSystem& files, const CancelToken& cancel) {
    try {
      const auto a = open_global_file(path("a"));
      ReorderSpec spilled = spec(GetParam(), "out");
      spilled.list_bytes = 2048;
      spilled.replace = false;
      reorder(*a, spilled, files, progress_, cancel);
    } catch (const Error& error) {
      return error.code();
    }
    return std::nullopt;
  }
};

TEST_P(ReorderErrors, DamagedInput) {
  const std::string intact = bytes("a");
  const auto file = open_global_file(path("a"));
  for (uint32_t l = 0; l <= file->brick_level(); ++l) {
    SCOPED_TRACE(l);
    std::string damaged = intact;
    const size_t at = file->level(l).file_offset + 4 * (file->level(l).word_count / 2);
    damaged[at] = static_cast<char>(damaged[at] ^ 4);
    write_bytes(path("a"), damaged);
    EXPECT_EQ(reorder_error(system_files(), never_), ErrorCode::kCorrupt);
    expect_files({"a"});
  }
}

// The disk is full from the write number `at` on.
TEST_P(ReorderErrors, FullDisk) {
  uint64_t failed = 0;
  for (uint64_t at = 1;; at += 1 + at / 4) {
    SCOPED_TRACE(at);
    crash::FaultyFiles files({crash::Fault::kNoSpace, at});
    const auto error = reorder_error(files, never_);
    if (!error) break;
    EXPECT_EQ(error, ErrorCode::kNoSpace);
    expect_files({"a"});
    ++failed;
  }
  EXPECT_GT(failed, 5u);
}

// The process is killed after `kill_after` operations. The next reorder() must then give the same
// bytes, and remove the temporary files of the killed process.
TEST_P(ReorderErrors, Killed) {
  reorder_error(system_files(), never_);
  const std::string clean = bytes("out");
  std::filesystem::remove(path("out"));
  uint64_t repeated = 0;
  for (uint64_t kill_after = 1;; kill_after += 1 + kill_after / 4) {
    SCOPED_TRACE(kill_after);
    if (!is_killed([&] {
          crash::FaultyFiles files({crash::Fault::kKillAfter, kill_after});
          reorder_error(files, never_);
        }))
      break;
    const auto error = reorder_error(system_files(), never_);
    const bool was_written = error == ErrorCode::kInvalidInput;
    EXPECT_TRUE(!error || was_written);
    repeated += !was_written;
    EXPECT_TRUE(bytes("out") == clean);
    expect_files({"a", "out"});
    std::filesystem::remove(path("out"));
  }
  EXPECT_GT(repeated, 5u);
}

TEST_P(ReorderErrors, Canceled) {
  CancelToken canceled;
  canceled.cancel();
  EXPECT_EQ(reorder_error(system_files(), canceled), ErrorCode::kCanceled);
  expect_files({"a"});
}

INSTANTIATE_TEST_SUITE_P(Orders, ReorderErrors,
                         testing::Values(NodeOrder::kByFirstParent, NodeOrder::kByHash));

// combine() rejects files in the order by first parent. But if the second file is moved, it can
// have this order, because combine() sorts the nodes of a moved file again.
TEST_F(Reorder, CombineNeedsTheOrderByHash) {
  write_global(path("a"), random_voxels(7, 64));
  write_global(path("b"), random_voxels(8, 64));
  reorder_file("a", spec(NodeOrder::kByFirstParent, "a2"));
  reorder_file("b", spec(NodeOrder::kByFirstParent, "b2"));
  const auto a = open_global_file(path("a")), b = open_global_file(path("b"));
  const auto a2 = open_global_file(path("a2")), b2 = open_global_file(path("b2"));
  CombineSpec combined;
  combined.output = path("c");
  combined.memory_bytes = uint64_t{64} << 20;
  combined.replace = true;
  const auto refused = [&](const voxdag_reader::File& left, const voxdag_reader::File& right) {
    return error_of([&] { combine(left, right, combined, system_files(), progress_, never_); });
  };
  for (const Error& error : {refused(*a2, *b), refused(*a, *b2)}) {
    EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
    EXPECT_NE(error.message().find("expected the order hash, which voxdag reorder --order hash"),
              std::string::npos)
        << error.message();
  }
  {
    const test::AudienceGuard python(kPythonUsers);
    EXPECT_TRUE(refused(*a2, *b).message().ends_with(
        "expected the order hash, which voxdag.reorder(order=\"hash\") writes"));
  }
  {
    const test::AudienceGuard others(test::kOtherUsers);
    EXPECT_TRUE(refused(*a2, *b).message().ends_with("expected the order hash"));
  }
  combined.offset = {0, 0, 0};
  combine(*a, *b, combined, system_files(), progress_, never_);
  const std::string expected = bytes("c");
  combine(*a, *b2, combined, system_files(), progress_, never_);
  EXPECT_TRUE(bytes("c") == expected);
}

}  // namespace
}  // namespace voxdag::query
