#include "core/io/outputs/space_reserve.h"

#include <algorithm>
#include <vector>

#include "tests/support/error_of.h"
#include "tests/support/temporary_folder.h"

namespace voxdag {
namespace {

constexpr uint64_t kMiB = uint64_t{1} << 20;

// Simulates a disk with `left` free bytes. Writes reduce `left`, but store nothing.
class CountingDisk : public ForwardingFiles {
 public:
  CountingDisk() : ForwardingFiles(system_files()) {}
  std::unique_ptr<WritableFile> create(const std::string& path) override {
    return std::make_unique<Writer>(*this, ForwardingFiles::create(path));
  }
  uint64_t free_space(const std::string&) override { return left; }
  uint64_t left = 100 * kMiB;

 private:
  class Writer : public ForwardingWriter {
   public:
    Writer(CountingDisk& disk, std::unique_ptr<WritableFile> file)
        : ForwardingWriter(std::move(file)), disk_(disk) {}
    void write_at(uint64_t, std::span<const std::byte> data) override { disk_.left -= data.size(); }

   private:
    CountingDisk& disk_;
  };
};

TEST(SpaceReserve, WritesStopAtTheReserve) {
  for (const size_t size : {size_t{1000}, size_t{64} << 10, size_t{3} << 20}) {
    SCOPED_TRACE(size);
    const TemporaryFolder folder;
    CountingDisk disk;
    SpaceReserve files(disk, 40 * kMiB);
    EXPECT_EQ(files.free_space(folder.path()), 60 * kMiB);
    const auto file = files.create(folder.file("f"));
    const std::vector<std::byte> data(size);
    const Error error = error_of([&] {
      for (;;) file->write_at(0, data);
    });
    EXPECT_EQ(error.code(), ErrorCode::kNoSpace);
    EXPECT_NE(error.message().find("40.00 MiB"), std::string::npos) << error.message();
    EXPECT_GE(disk.left, 39 * kMiB);
    EXPECT_LE(disk.left, 44 * kMiB);
    EXPECT_LE(files.free_space(folder.path()), 4 * kMiB);
    disk.left = 60 * kMiB;  // somebody frees space
    file->write_at(0, data);
  }
}

TEST(SpaceReserve, NoReserveChangesNothing) {
  const TemporaryFolder folder;
  CountingDisk disk;
  SpaceReserve files(disk, 0);
  const std::vector<std::byte> data(kMiB);
  const auto file = files.create(folder.file("f"));
  for (int i = 0; i < 100; ++i) file->write_at(0, data);
  EXPECT_EQ(disk.left, 0u);
}

}  // namespace
}  // namespace voxdag
