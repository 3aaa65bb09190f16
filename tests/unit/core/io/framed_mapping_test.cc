#include "core/io/framed_mapping.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <vector>

#include "core/base/error.h"
#include "tests/support/error_of.h"
#include "tests/support/temporary_folder.h"

namespace voxdag {
namespace {

using Bytes = std::vector<std::byte>;

class FramedMappingTest : public testing::Test {
 protected:
  // Writes a file of this size. No two pages are equal.
  void write(uint64_t bytes) {
    bytes_.resize(bytes);
    for (uint64_t i = 0; i < bytes; ++i) bytes_[i] = static_cast<std::byte>(i % 251);
    std::ofstream(path_, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes_.data()), static_cast<std::streamsize>(bytes));
  }
  // Returns the expected bytes of a mapping.
  Bytes framed(const Bytes& head, uint64_t tail_offset, const Bytes& tail) const {
    Bytes all(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(tail_offset));
    std::ranges::copy(head, all.begin());
    all.insert(all.end(), tail.begin(), tail.end());
    return all;
  }

  const TemporaryFolder folder_;
  const std::string path_ = folder_.file("file");
  const uint64_t page_ = static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
  Bytes bytes_;
};

TEST_F(FramedMappingTest, ReplacesTheHeadAndAppendsTheTail) {
  write(8 * page_ + 100);
  for (const uint64_t head_bytes : {uint64_t{0}, uint64_t{1}, page_, page_ + 1, 3 * page_})
    for (const uint64_t tail_offset :
         {3 * page_, 3 * page_ + 1, 4 * page_, 5 * page_ - 1, 8 * page_ + 100})
      for (const uint64_t tail_bytes : {uint64_t{0}, uint64_t{7}, 2 * page_}) {
        const Bytes head(head_bytes, std::byte{255}), tail(tail_bytes, std::byte{254});
        const FramedMapping mapping(path_, head, tail_offset, tail);
        const std::span bytes(mapping.data(), mapping.size());
        EXPECT_TRUE(std::ranges::equal(bytes, framed(head, tail_offset, tail)))
            << head_bytes << " " << tail_offset << " " << tail_bytes;
      }
}

TEST_F(FramedMappingTest, OutlivesTheNameOfTheFile) {
  write(4 * page_);
  const FramedMapping mapping(path_, Bytes(8), 4 * page_, Bytes(8));
  std::filesystem::rename(path_, folder_.file("renamed"));
  EXPECT_EQ(mapping.data()[2 * page_], bytes_[2 * page_]);
}

TEST_F(FramedMappingTest, RefusesOtherFiles) {
  write(page_);
  const auto code = [&](const std::string& path, uint64_t head_bytes, uint64_t tail_offset) {
    return error_of([&] { FramedMapping(path, Bytes(head_bytes), tail_offset, Bytes(8)); }).code();
  };
  EXPECT_EQ(code(path_, 8, page_ + 1), ErrorCode::kCorrupt) << "shorter than the tail's offset";
  EXPECT_EQ(code(path_, 9, 8), ErrorCode::kCorrupt) << "head and tail overlap";
  EXPECT_EQ(code(path_, 0, UINT64_MAX), ErrorCode::kCorrupt);
  EXPECT_EQ(code(folder_.file("none"), 0, 0), ErrorCode::kNotFound);
  EXPECT_EQ(code(folder_.path(), 0, 0), ErrorCode::kInvalidInput);
  std::filesystem::create_symlink(path_, folder_.file("link"));
  EXPECT_EQ(code(folder_.file("link"), 0, 8), ErrorCode::kInvalidInput);
}

}  // namespace
}  // namespace voxdag
