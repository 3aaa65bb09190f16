#include <gtest/gtest.h>

#include <algorithm>

#include "core/base/error.h"
#include "core/io/forwarding_files.h"
#include "tests/support/temporary_folder.h"

namespace voxdag {
namespace {

// Forwards to the real disk, but lets call number `fails_at` fail. Remembers the calls.
class FailingDisk : public ForwardingFiles {
 public:
  explicit FailingDisk(int fails_at) : ForwardingFiles(system_files()), fails_at_(fails_at) {}
  std::vector<std::string> calls;

  std::unique_ptr<WritableFile> create(const std::string& path) override {
    step("create");
    return std::make_unique<File>(*this, ForwardingFiles::create(path));
  }
  void rename(const std::string& from, const std::string& to) override {
    step("rename");
    ForwardingFiles::rename(from, to);
  }
  void sync_directory(const std::string& path) override {
    step("sync_directory");
    ForwardingFiles::sync_directory(path);
  }

 private:
  class File : public ForwardingWriter {
   public:
    File(FailingDisk& disk, std::unique_ptr<WritableFile> file)
        : ForwardingWriter(std::move(file)), disk_(disk) {}
    void write_at(uint64_t offset, std::span<const std::byte> data) override {
      disk_.step("write");
      ForwardingWriter::write_at(offset, data);
    }
    void sync() override {
      disk_.step("sync");
      ForwardingWriter::sync();
    }
    void close() override {
      disk_.step("close");
      ForwardingWriter::close();
    }

   private:
    FailingDisk& disk_;
  };

  void step(const char* call) {
    calls.push_back(call);
    if (static_cast<int>(calls.size()) == fails_at_)
      throw Error(ErrorCode::kIo, std::string(call) + " failed");
  }

  const int fails_at_;
};

// The order of the calls is right for a power cut at any time: the contents are durable before they
// get the name, and the name is durable before write_file_atomically() returns.
TEST(AtomicWrite, SyncsBeforeRenaming) {
  TemporaryFolder folder;
  FailingDisk disk(0);
  write_file_atomically(disk, folder.file("f"), "contents");
  EXPECT_EQ(disk.calls, (std::vector<std::string>{"create", "write", "sync", "close", "rename",
                                                  "sync_directory"}));
  EXPECT_EQ(read_small_file(disk, folder.file("f"), 100), "contents");
  EXPECT_EQ(disk.list(folder.path()).size(), 1u) << "something was left next to the file";
}

// If any call fails, the error is rethrown, and the file has its old or its new contents.
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
