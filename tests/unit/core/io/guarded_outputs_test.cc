#include "core/io/outputs/guarded_outputs.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <functional>

#include "core/io/overwrite.h"
#include "tests/support/error_of.h"
#include "tests/support/temporary_folder.h"

namespace voxdag {
namespace {

class GuardedOutputsTest : public testing::Test {
 protected:
  void put(const std::string& path, const std::string& text) {
    write_file_atomically(system_files(), path, text);
  }
  std::string get(const std::string& path) { return read_small_file(system_files(), path, 100); }
  // Expects that `call` is refused and that the other program's file at `path` is kept.
  void expect_kept(const std::string& path, const std::function<void()>& call) {
    EXPECT_EQ(error_of(call).code(), ErrorCode::kInvalidInput);
    EXPECT_EQ(get(path), "theirs");
  }

  TemporaryFolder folder_;
  const std::string out_ = folder_.file("out"), partial_ = out_ + ".partial";
  GuardedOutputs files_{system_files()};
};

TEST_F(GuardedOutputsTest, FilesThatAppearAreKept) {
  files_.guard_output(out_);
  put(out_, "theirs");
  expect_kept(out_, [&] { write_file_atomically(files_, out_, "ours"); });
  expect_kept(out_, [&] { files_.remove(out_); });
  put(partial_, "theirs");
  expect_kept(partial_, [&] { files_.create(partial_); });
}

TEST_F(GuardedOutputsTest, OnlyTheFileOfTheCheckIsReplaced) {
  put(out_, "old");
  files_.guard_output(out_);
  write_file_atomically(files_, out_, "first");
  write_file_atomically(files_, out_, "second");  // the command's own file
  EXPECT_EQ(get(out_), "second");
  GuardedOutputs later(system_files());
  later.guard_output(out_);
  put(out_, "theirs");
  expect_kept(out_, [&] { write_file_atomically(later, out_, "ours"); });
}

TEST_F(GuardedOutputsTest, LinksAndUnreadableFilesAreKept) {
  files_.guard_output(out_);
  ASSERT_EQ(symlink("/nonexistent", out_.c_str()), 0);
  EXPECT_EQ(error_of([&] { write_file_atomically(files_, out_, "ours"); }).code(),
            ErrorCode::kInvalidInput);
  ASSERT_EQ(unlink(out_.c_str()), 0);
  EXPECT_FALSE(files_.exists(partial_));
  ASSERT_EQ(mkfifo(out_.c_str(), 0600), 0);
  EXPECT_EQ(error_of([&] { write_file_atomically(files_, out_, "ours"); }).code(),
            ErrorCode::kInvalidInput);
}

TEST_F(GuardedOutputsTest, OtherPathsAreNotGuarded) {
  files_.guard_output(out_);
  put(folder_.file("other"), "old");
  write_file_atomically(files_, folder_.file("other"), "new");
  EXPECT_EQ(get(folder_.file("other")), "new");
}

// Both ways of renaming, with and without renameat2(), rename a file but never replace one.
TEST_F(GuardedOutputsTest, RenamesWithoutReplacing) {
  for (const auto rename : {rename_without_replacing, rename_by_link}) {
    put(partial_, "ours");
    EXPECT_EQ(rename(partial_, out_), 0);
    EXPECT_EQ(get(out_), "ours");
    EXPECT_FALSE(files_.exists(partial_));
    put(out_, "theirs");
    put(partial_, "ours");
    EXPECT_EQ(rename(partial_, out_), EEXIST);
    EXPECT_EQ(get(out_), "theirs");
    EXPECT_EQ(get(partial_), "ours");
    files_.remove(out_);
    EXPECT_EQ(rename(folder_.file("none"), out_), ENOENT);
  }
}

TEST_F(GuardedOutputsTest, OwnFilesAreNoLinks) {
  put(out_, "text");
  EXPECT_EQ(read_own_file(files_, out_, 100), "text");
  EXPECT_EQ(error_of([&] { read_own_file(files_, out_, 3); }).code(), ErrorCode::kLimit);
  ASSERT_EQ(symlink(out_.c_str(), folder_.file("link").c_str()), 0);
  EXPECT_EQ(get(folder_.file("link")), "text");
  ForwardingFiles forwarding(system_files());
  for (FileSystem* const files : std::initializer_list<FileSystem*>{&files_, &forwarding}) {
    EXPECT_EQ(files->open_own(out_)->size(), 4u);
    EXPECT_EQ(error_of([&] { files->open_own(folder_.file("link")); }).code(),
              ErrorCode::kInvalidInput);
  }
}

}  // namespace
}  // namespace voxdag
