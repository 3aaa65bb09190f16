#include "core/format/global/page_limit.h"

#include <gtest/gtest.h>

#include <fstream>

#include "core/format/global/global_layout.h"
#include "core/format/global/open_global.h"
#include "tests/unit/core/format/test_files.h"

namespace voxdag {
namespace {

// Returns the resident bytes of this process's mapping of the file "pages.vdag"; 0 if no page is
// resident.
uint64_t resident_bytes_of_file() {
  std::ifstream maps("/proc/self/smaps");
  std::string line;
  bool is_found = false;
  while (std::getline(maps, line)) {
    is_found |= line.ends_with("/pages.vdag");
    if (is_found && line.starts_with("Rss:")) return 1024 * std::stoull(line.substr(4));
  }
  ADD_FAILURE() << "the file is not mapped";
  return 0;
}

TEST(PageLimitTest, DropsPagesOnlyAboveTheLimit) {
  const TemporaryFolder folder;
  const std::string path = folder.file("pages.vdag");
  write_global(path, random_voxels(5, 128));
  const auto file = open_global_file(path);
  const auto read = [&] {
    volatile unsigned char sum = 0;
    for (uint64_t at = 0; at < file->file_bytes(); at += global_layout::kPageBytes)
      sum = static_cast<unsigned char>(sum + file->data()[at]);
  };
  PageLimit high(*file, ~uint64_t{0}, 100), low(*file, 0, 100);
  read();
  ASSERT_GE(resident_bytes_of_file(), file->file_bytes());
  high.touch(1000);
  EXPECT_GE(resident_bytes_of_file(), file->file_bytes());
  low.touch(99);  // the first interval has not ended
  EXPECT_GE(resident_bytes_of_file(), file->file_bytes());
  low.touch(1);
  EXPECT_EQ(resident_bytes_of_file(), 0u);
  read();
  EXPECT_GE(resident_bytes_of_file(), file->file_bytes());
}

}  // namespace
}  // namespace voxdag
