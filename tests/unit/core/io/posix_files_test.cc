#include <gtest/gtest.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <functional>
#include <thread>

#include "core/base/error.h"
#include "core/io/file_system.h"
#include "tests/support/temporary_folder.h"

namespace voxdag {
namespace {

std::span<const std::byte> bytes(std::string_view text) { return std::as_bytes(std::span(text)); }

std::string read(const ReadableFile& file, uint64_t offset, size_t size) {
  std::string text(size, '?');
  file.read_at(offset, std::as_writable_bytes(std::span(text)));
  return text;
}

void expect_error(ErrorCode code, const std::string& part, const std::function<void()>& call) {
  try {
    call();
    ADD_FAILURE() << "no error, expected one of " << error_name(code) << " with " << part;
  } catch (const Error& error) {
    EXPECT_STREQ(error_name(error.code()), error_name(code)) << error.message();
    EXPECT_NE(error.message().find(part), std::string::npos) << error.message();
  }
}

class PosixFiles : public testing::Test {
 protected:
  TemporaryFolder folder_;
  FileSystem& files_ = system_files();
  const std::string path_ = folder_.file("data");

  void put(const std::string& path, std::string_view text) {
    const auto file = files_.create(path);
    file->write_at(0, bytes(text));
    file->close();
  }
};

// Data written at offsets in any order is read back; holes are zero-filled.
TEST_F(PosixFiles, ReadsWhatWasWritten) {
  const auto out = files_.create(path_);
  EXPECT_EQ(out->path(), path_);
  out->write_at(6, bytes("world"));
  out->write_at(0, bytes("hello"));
  out->sync();
  out->close();
  const auto in = files_.open_read(path_);
  EXPECT_EQ(in->path(), path_);
  EXPECT_EQ(in->size(), 11u);
  EXPECT_EQ(read(*in, 0, 11), std::string("hello\0world", 11));
  EXPECT_EQ(read(*in, 8, 3), "rld");
  EXPECT_EQ(read(*in, 11, 0), "");
}

// Offsets are 64-bit: beyond 4 GiB nothing wraps.
TEST_F(PosixFiles, ReachesBeyondFourGibibytes) {
  const uint64_t far = (uint64_t{5} << 30) + 3;
  const auto out = files_.create(path_);
  out->write_at(far, bytes("far"));
  out->write_at(3, bytes("near"));
  const auto in = files_.open_read(path_);
  EXPECT_EQ(in->size(), far + 3);
  EXPECT_EQ(read(*in, far, 3), "far");
  EXPECT_EQ(read(*in, 3, 4), "near");
}

// Reading beyond the end of a file is kCorrupt. The message gives the position.
TEST_F(PosixFiles, ReadingPastTheEndIsCorrupt) {
  put(path_, "0123456789");
  const auto in = files_.open_read(path_);
  expect_error(ErrorCode::kCorrupt, path_, [&] { read(*in, 8, 3); });
  expect_error(ErrorCode::kCorrupt, "byte 10", [&] { read(*in, 8, 3); });
  expect_error(ErrorCode::kCorrupt, "byte 100", [&] { read(*in, 100, 1); });
}

// create() empties an existing file; open_write() keeps its contents.
TEST_F(PosixFiles, CreateEmptiesAndOpenWriteKeeps) {
  put(path_, "abcdef");
  files_.open_write(path_)->write_at(2, bytes("XX"));
  EXPECT_EQ(read_small_file(files_, path_, 100), "abXXef");
  files_.create(path_)->close();
  EXPECT_EQ(read_small_file(files_, path_, 100), "");
  files_.open_write(folder_.file("new"))->write_at(0, bytes("n"));
  EXPECT_EQ(read_small_file(files_, folder_.file("new"), 100), "n");
}

// Each call on a missing file or folder throws kNotFound and names the path.
TEST_F(PosixFiles, MissingThingsAreNotFound) {
  const std::string gone = folder_.file("gone"), inside = folder_.file("gone/file");
  const auto expect_not_found = [&](const std::function<void()>& call) {
    expect_error(ErrorCode::kNotFound, gone, call);
  };
  expect_not_found([&] { files_.open_read(gone); });
  expect_not_found([&] { files_.create(inside); });
  expect_not_found([&] { files_.open_write(inside); });
  expect_not_found([&] { files_.rename(gone, path_); });
  expect_not_found([&] { files_.remove(gone); });
  expect_not_found([&] { files_.remove_directory(gone); });
  expect_not_found([&] { files_.list(gone); });
  expect_not_found([&] { files_.sync_directory(gone); });
  expect_not_found([&] { files_.free_space(gone); });
  expect_not_found([&] { files_.device(gone); });
  EXPECT_FALSE(files_.exists(gone));
}

// A file where a folder is expected is an error, and so is a folder where a file is expected.
TEST_F(PosixFiles, FilesAreNotFolders) {
  put(path_, "x");
  EXPECT_FALSE(files_.exists(path_ + "/below"));
  expect_error(ErrorCode::kNotFound, path_, [&] { files_.create(path_ + "/below"); });
  expect_error(ErrorCode::kInvalidInput, folder_.path(), [&] { files_.open_read(folder_.path()); });
  expect_error(ErrorCode::kIo, folder_.path(), [&] { files_.create(folder_.path()); });
  for (const std::string& path : {path_, path_ + "/below"})
    expect_error(ErrorCode::kInvalidInput, "expected a folder",
                 [&] { files_.make_directories(path); });
  expect_error(ErrorCode::kInvalidInput, "expected a folder", [&] { files_.list(path_); });
}

// A full disk has a separate code. /dev/full is always full.
TEST_F(PosixFiles, FullDiskIsNoSpace) {
  if (!files_.exists("/dev/full")) GTEST_SKIP() << "this system has no /dev/full";
  const auto full = files_.create("/dev/full");
  expect_error(ErrorCode::kNoSpace, "/dev/full at offset 0",
               [&] { full->write_at(0, bytes("x")); });
}

// Folders are created with their parents and listed. Only empty folders are removed.
TEST_F(PosixFiles, Folders) {
  const std::string deep = folder_.file("a/b/c");
  files_.make_directories(deep);
  files_.make_directories(deep + "/");
  put(folder_.file("a/file"), "x");
  auto entries = files_.list(folder_.file("a"));
  std::sort(entries.begin(), entries.end(),
            [](const auto& x, const auto& y) { return x.name < y.name; });
  ASSERT_EQ(entries.size(), 2u);
  EXPECT_EQ(entries[0].name, "b");
  EXPECT_TRUE(entries[0].is_directory);
  EXPECT_EQ(entries[1].name, "file");
  EXPECT_FALSE(entries[1].is_directory);
  files_.sync_directory(folder_.file("a"));
  expect_error(ErrorCode::kIo, "a", [&] { files_.remove_directory(folder_.file("a")); });
  files_.remove_directory(deep);
  EXPECT_FALSE(files_.exists(deep));
  EXPECT_GT(files_.free_space(deep.substr(0, deep.size() - 2)), 0u);
}

// Files in one folder are on the same device; /proc is a different device.
TEST_F(PosixFiles, DevicesTellDisksApart) {
  put(path_, "x");
  EXPECT_EQ(files_.device(path_), files_.device(folder_.path()));
  if (!files_.exists("/proc")) GTEST_SKIP() << "this system has no /proc";
  EXPECT_NE(files_.device("/proc"), files_.device(folder_.path()));
}

// rename() replaces an existing file. remove() deletes a file.
TEST_F(PosixFiles, RenameReplaces) {
  put(path_, "new");
  put(folder_.file("old"), "old");
  files_.rename(path_, folder_.file("old"));
  EXPECT_FALSE(files_.exists(path_));
  EXPECT_EQ(read_small_file(files_, folder_.file("old"), 3), "new");
  files_.remove(folder_.file("old"));
  EXPECT_FALSE(files_.exists(folder_.file("old")));
}

// Threads may write and read disjoint parts of one file concurrently.
TEST_F(PosixFiles, ThreadsShareAFile) {
  constexpr size_t kPart = 100000;
  const auto out = files_.create(path_);
  const auto in = files_.open_read(path_);
  std::vector<std::thread> threads;
  std::atomic<int> wrong{0};
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      const std::string text(kPart, static_cast<char>('a' + t));
      out->write_at(static_cast<uint64_t>(t) * kPart, bytes(text));
      wrong += read(*in, static_cast<uint64_t>(t) * kPart, kPart) != text;
    });
  for (std::thread& t : threads) t.join();
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(files_.open_read(path_)->size(), 4 * kPart);
}

// A lock has one holder until it goes out of scope. The lock file remains.
TEST_F(PosixFiles, LocksAreExclusive) {
  auto first = files_.try_lock(path_);
  ASSERT_NE(first, nullptr);
  EXPECT_EQ(files_.try_lock(path_), nullptr);
  EXPECT_NE(files_.try_lock(folder_.file("other")), nullptr);
  first.reset();
  EXPECT_NE(files_.try_lock(path_), nullptr);
  EXPECT_TRUE(files_.exists(path_));
  expect_error(ErrorCode::kNotFound, "gone", [&] { files_.try_lock(folder_.file("gone/lock")); });
}

// A process that may only read a file can see whether the file is locked.
TEST_F(PosixFiles, LocksAreVisible) {
  put(path_, "holder");
  EXPECT_FALSE(files_.is_locked(path_));
  const auto lock = files_.try_lock(path_);
  std::filesystem::permissions(path_, std::filesystem::perms::owner_read);
  EXPECT_TRUE(files_.is_locked(path_));
}

// A link, symbolic or hard, could lead to any file, so files are not opened for writing through
// links.
TEST_F(PosixFiles, LinksAreNotChanged) {
  const std::string link = folder_.file("link");
  put(path_, "precious");
  for (const bool hard : {false, true}) {
    SCOPED_TRACE(hard ? "hard" : "symbolic");
    if (hard)
      std::filesystem::create_hard_link(path_, link);
    else
      std::filesystem::create_symlink(path_, link);
    for (const std::function<void()>& change : std::initializer_list<std::function<void()>>{
             [&] { files_.create(link); }, [&] { files_.open_write(link); },
             [&] { files_.try_lock(link); }})
      expect_error(ErrorCode::kInvalidInput, hard ? "several names" : "symbolic link", change);
    EXPECT_EQ(read_small_file(files_, path_, 100), "precious");
    std::filesystem::remove(link);
  }
  ASSERT_EQ(mkfifo(link.c_str(), 0600), 0);
  expect_error(ErrorCode::kInvalidInput, "not a regular file", [&] { files_.try_lock(link); });
  EXPECT_TRUE(std::ranges::any_of(files_.list(folder_.path()), [](const DirectoryEntry& entry) {
    return entry.name == "link" && entry.is_special;
  }));
}

// A process that dies leaves no lock behind.
TEST_F(PosixFiles, LocksEndWithTheProcess) {
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    auto lock = files_.try_lock(path_);
    raise(SIGKILL);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFSIGNALED(status));
  EXPECT_NE(files_.try_lock(path_), nullptr);
}

// close() may be called twice.
TEST_F(PosixFiles, CloseMayBeCalledTwice) {
  const auto file = files_.create(path_);
  file->close();
  EXPECT_NO_THROW(file->close());
}

// read_small_file() refuses a file above the given size, and the error names the limit.
TEST_F(PosixFiles, SmallFilesAreSmall) {
  put(path_, "12345");
  EXPECT_EQ(read_small_file(files_, path_, 5), "12345");
  expect_error(ErrorCode::kLimit, "at most 4", [&] { read_small_file(files_, path_, 4); });
}

// An unchanged file keeps its identity. A file that was changed in place, replaced or appended to
// has a different one, even if its time is set back.
TEST_F(PosixFiles, IdentityTellsAChange) {
  put(path_, "12345");
  const auto identity = [&] { return files_.open_read(path_)->identity(); };
  const FileIdentity first = identity();
  EXPECT_EQ(first.bytes, 5u);
  // Waits longer than one tick of the clock of file times.
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_EQ(identity(), first);
  const auto time = std::filesystem::last_write_time(path_);
  files_.open_write(path_)->write_at(2, bytes("x"));
  std::filesystem::last_write_time(path_, time);
  const FileIdentity changed = identity();
  EXPECT_EQ(changed.modified_ns, first.modified_ns);
  EXPECT_NE(changed, first);
  files_.open_write(path_)->write_at(5, bytes("6"));
  EXPECT_EQ(identity().bytes, 6u);
  const FileIdentity grown = identity();
  put(folder_.file("other"), "12345x");
  files_.rename(folder_.file("other"), path_);
  EXPECT_NE(identity().inode, grown.inode);
}

}  // namespace
}  // namespace voxdag
