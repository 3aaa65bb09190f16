#include "core/io/buffered/small_file.h"

#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "tests/support/error_of.h"

namespace voxdag {
namespace {

// Counts the reads of a file with these bytes.
class CountedFile : public ReadableFile {
 public:
  CountedFile(std::string bytes, int& reads) : bytes_(std::move(bytes)), reads_(reads) {}
  const std::string& path() const override { return path_; }
  uint64_t size() const override { return bytes_.size(); }
  FileIdentity identity() const override { return {7, bytes_.size(), 8, 9}; }
  void read_at(uint64_t offset, std::span<std::byte> out) const override {
    ++reads_;
    if (offset > bytes_.size() || out.size() > bytes_.size() - offset)
      throw Error(ErrorCode::kCorrupt, path_ + " ends early");
    if (!out.empty()) std::memcpy(out.data(), bytes_.data() + offset, out.size());
  }

 private:
  const std::string path_ = "a/b";
  const std::string bytes_;
  int& reads_;
};

std::string bytes_at(const ReadableFile& file, uint64_t offset, size_t bytes) {
  std::string text(bytes, '?');
  file.read_at(offset, std::as_writable_bytes(std::span(text)));
  return text;
}

TEST(SmallFile, IsReadOnce) {
  MemoryBudget budget(1 << 20);
  int reads = 0;
  {
    const auto file =
        SmallFiles(10, budget).read(std::make_unique<CountedFile>("0123456789", reads));
    EXPECT_EQ(budget.used(), 10u);
    EXPECT_EQ(bytes_at(*file, 0, 10), "0123456789");
    EXPECT_EQ(bytes_at(*file, 3, 4), "3456");
    EXPECT_EQ(bytes_at(*file, 10, 0), "");
    EXPECT_EQ(reads, 1);
    EXPECT_EQ(file->path(), "a/b");
    EXPECT_EQ(file->size(), 10u);
    EXPECT_EQ(file->identity().inode, 7u);
    for (const uint64_t offset : {uint64_t{9}, uint64_t{11}, UINT64_MAX}) {
      const Error error = error_of([&] { bytes_at(*file, offset, 2); });
      EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
      EXPECT_EQ(error.message(), "a/b ends early");
    }
  }
  EXPECT_EQ(budget.used(), 0u);
}

TEST(SmallFile, OtherFilesAreReadInParts) {
  int reads = 0;
  MemoryBudget small(1000), large(1 << 30);
  const std::string bytes(5001, 'x');
  for (MemoryBudget* budget : {&small, &large}) {
    const size_t size = budget == &small ? 100 : bytes.size();
    const auto file =
        SmallFiles(5000, *budget).read(std::make_unique<CountedFile>(bytes.substr(0, size), reads));
    EXPECT_EQ(budget->used(), 0u);
    EXPECT_EQ(reads, 0);
    EXPECT_EQ(bytes_at(*file, 0, 3), "xxx");
    EXPECT_EQ(reads, 1);
    reads = 0;
  }
}

// Files that fit are read into memory even if an earlier file did not fit.
TEST(SmallFile, AllFilesTogetherAreLimited) {
  int reads = 0;
  MemoryBudget budget(1 << 20);
  SmallFiles files(100, budget);
  std::vector<std::unique_ptr<ReadableFile>> open;
  for (const size_t size : {60u, 50u, 40u, 1u})
    open.push_back(files.read(std::make_unique<CountedFile>(std::string(size, 'x'), reads)));
  EXPECT_EQ(budget.used(), 100u);
  EXPECT_EQ(reads, 2);
}

}  // namespace
}  // namespace voxdag
