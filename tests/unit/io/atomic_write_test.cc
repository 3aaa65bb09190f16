#include <gtest/gtest.h>

#include <algorithm>

#include "core/base/error.h"
#include "core/io/file_system.h"
#include "tests/unit/io/temporary_folder.h"

namespace voxdag {
namespace {

// The real disk, except that call number `fails_at` fails; remembers the calls.
class FailingDisk : public FileSystem {
 public:
  explicit FailingDisk(int fails_at) : fails_at_(fails_at) {}
  std::vector<std::string> calls;

  std::unique_ptr<ReadableFile> open_read(const std::string& p) override {
    return disk_.open_read(p);
  }
  std::unique_ptr<WritableFile> create(const std::string& p) override {
    step("create");
    return std::make_unique<File>(*this, disk_.create(p));
  }
  std::unique_ptr<WritableFile> open_write(const std::string& p) override { return create(p); }
  bool exists(const std::string& p) override { return disk_.exists(p); }
  void rename(const std::string& from, const std::string& to) override {
    step("rename");
    disk_.rename(from, to);
  }
  void remove(const std::string& p) override { disk_.remove(p); }
  void make_directories(const std::string& p) override { disk_.make_directories(p); }
  void remove_directory(const std::string& p) override { disk_.remove_directory(p); }
  std::vector<DirectoryEntry> list(const std::string& p) override { return disk_.list(p); }
  void touch(const std::string& p) override { disk_.touch(p); }
  void sync_directory(const std::string& p) override {
    step("sync_directory");
    disk_.sync_directory(p);
  }
  std::unique_ptr<FileLock> try_lock(const std::string& p) override { return disk_.try_lock(p); }
  uint64_t free_space(const std::string& p) override { return disk_.free_space(p); }

 private:
  class File : public WritableFile {
   public:
    File(FailingDisk& disk, std::unique_ptr<WritableFile> file)
        : disk_(disk), file_(std::move(file)) {}
    const std::string& path() const override { return file_->path(); }
    void write_at(uint64_t offset, std::span<const std::byte> data) override {
      disk_.step("write");
      file_->write_at(offset, data);
    }
    void sync() override {
      disk_.step("sync");
      file_->sync();
    }
    void close() override {
      disk_.step("close");
      file_->close();
    }

   private:
    FailingDisk& disk_;
    std::unique_ptr<WritableFile> file_;
  };

  void step(const char* call) {
    calls.push_back(call);
    if (static_cast<int>(calls.size()) == fails_at_)
      throw Error(ErrorCode::kIo, std::string(call) + " failed");
  }

  FileSystem& disk_ = system_files();
  const int fails_at_;
};

// The order that survives a power cut: the contents are on the disk before they get the name, and
// the name before anybody is told.
TEST(AtomicWrite, SyncsBeforeRenaming) {
  TemporaryFolder folder;
  FailingDisk disk(0);
  write_file_atomically(disk, folder.file("f"), "contents");
  EXPECT_EQ(disk.calls, (std::vector<std::string>{"create", "write", "sync", "close", "rename",
                                                  "sync_directory"}));
  EXPECT_EQ(read_small_file(disk, folder.file("f"), 100), "contents");
  EXPECT_EQ(disk.list(folder.path()).size(), 1u) << "something was left beside the file";
}

// Whichever call fails, the error comes through and the name holds the old or the new contents.
TEST(AtomicWrite, IsWholeOrNotAtAll) {
  for (int fails_at = 1; fails_at <= 6; ++fails_at) {
    SCOPED_TRACE(fails_at);
    TemporaryFolder folder;
    const std::string path = folder.file("f");
    write_file_atomically(system_files(), path, "the old contents");
    FailingDisk disk(fails_at);
    EXPECT_THROW(write_file_atomically(disk, path, "the new ones"), Error);
    EXPECT_EQ(read_small_file(disk, path, 100),
              disk.calls.back() == "sync_directory" ? "the new ones" : "the old contents");
  }
}

}  // namespace
}  // namespace voxdag
