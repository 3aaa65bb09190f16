#include "core/io/watched_mapping.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdlib>
#include <memory>
#include <vector>

#include "core/base/process_limits.h"

namespace voxdag {
namespace {

// A temporary file that is mapped to memory. All its bytes are 1.
class Mapped {
 public:
  explicit Mapped(size_t pages) : bytes_(pages * sysconf(_SC_PAGESIZE)) {
    char name[] = "/tmp/voxdag-mapping-XXXXXX";
    fd_ = mkstemp(name);
    unlink(name);
    const std::vector<char> ones(bytes_, 1);
    EXPECT_EQ(write(fd_, ones.data(), bytes_), static_cast<ssize_t>(bytes_));
    data_ = static_cast<char*>(mmap(nullptr, bytes_, PROT_READ, MAP_SHARED, fd_, 0));
  }
  ~Mapped() {
    munmap(data_, bytes_);
    close(fd_);
  }
  Mapped(const Mapped&) = delete;
  const char* data() const { return data_; }
  size_t bytes() const { return bytes_; }
  void truncate(size_t bytes) const { EXPECT_EQ(ftruncate(fd_, static_cast<off_t>(bytes)), 0); }
  int sum() const {
    int sum = 0;
    for (size_t i = 0; i < bytes_; i += 1024)
      sum += reinterpret_cast<const volatile char*>(data_)[i];
    return sum;
  }

 private:
  size_t bytes_;
  int fd_ = -1;
  char* data_ = nullptr;
};

TEST(WatchedMapping, WhatIsGoneReadsAsZeros) {
  const Mapped file(8), other(8);
  const int whole = file.sum();
  const WatchedMapping watched(file.data(), file.bytes()), undamaged(other.data(), other.bytes());
  EXPECT_FALSE(watched.is_damaged());
  file.truncate(file.bytes() / 2);
  EXPECT_EQ(file.sum(), whole / 2);
  EXPECT_TRUE(watched.is_damaged());
  EXPECT_EQ(other.sum(), whole);
  EXPECT_FALSE(undamaged.is_damaged());
}

// Damage of a mapping is forgotten when its WatchedMapping ends. The next watched mapping begins as
// undamaged.
TEST(WatchedMapping, DamageEndsWithTheWatch) {
  const Mapped file(2);
  {
    const WatchedMapping watched(file.data(), file.bytes());
    file.truncate(0);
    file.sum();
    EXPECT_TRUE(watched.is_damaged());
  }
  const Mapped next(2);
  EXPECT_FALSE(WatchedMapping(next.data(), next.bytes()).is_damaged());
}

// A fault outside watched mappings still ends the process with SIGBUS. A sanitizer would catch the
// signal, so the next two tests exist only in builds without sanitizers.
#if !VOXDAG_SANITIZED
TEST(WatchedMapping, OthersStillEndTheProcess) {
  const Mapped watched_file(1), file(1);
  const WatchedMapping watched(watched_file.data(), watched_file.bytes());
  file.truncate(0);
  EXPECT_EXIT(file.sum(), testing::KilledBySignal(SIGBUS), "");
}

TEST(WatchedMapping, MoreThanAreWatchedAreAsBefore) {
  const Mapped file(1), extra(1);
  std::vector<std::unique_ptr<WatchedMapping>> all;
  for (int i = 0; i < WatchedMapping::kMaxWatched; ++i)
    all.push_back(std::make_unique<WatchedMapping>(file.data(), file.bytes()));
  const WatchedMapping one_more(extra.data(), extra.bytes());
  extra.truncate(0);
  EXPECT_EXIT(extra.sum(), testing::KilledBySignal(SIGBUS), "");
}
#endif

}  // namespace
}  // namespace voxdag
