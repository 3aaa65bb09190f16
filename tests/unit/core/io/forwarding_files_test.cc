#include "core/io/forwarding_files.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "core/base/error.h"
#include "tests/support/temporary_folder.h"

namespace voxdag {
namespace {

// When the first file is opened, immediately replaces it at its path with the file `other`.
class ReplacedFiles : public ForwardingFiles {
 public:
  using ForwardingFiles::ForwardingFiles;
  std::string other;

 private:
  std::unique_ptr<ReadableFile> reader_of(std::unique_ptr<ReadableFile> file) override {
    ++opened_;
    if (opened_ == 1) std::filesystem::rename(other, file->path());
    return std::make_unique<ForwardingReader>(std::move(file));
  }
  int opened_ = 0;
};

// open_own() opens the path only once. So it returns the original file, even if another file
// replaces this file immediately after it was opened. Like the wrapped file system, it refuses
// links.
TEST(ForwardingFilesTest, OpensAFileOnce) {
  const TemporaryFolder folder;
  const std::string path = folder.file("a");
  write_file_atomically(system_files(), path, "first");
  write_file_atomically(system_files(), folder.file("b"), "other file");
  ReplacedFiles files(system_files());
  files.other = folder.file("b");
  EXPECT_EQ(files.open_own(path)->size(), 5u);
  EXPECT_EQ(files.open_own(path)->size(), 10u);
  std::filesystem::create_symlink(path, folder.file("link"));
  EXPECT_EQ(files.open_read(folder.file("link"))->size(), 10u);
  EXPECT_THROW(files.open_own(folder.file("link")), Error);
}

}  // namespace
}  // namespace voxdag
