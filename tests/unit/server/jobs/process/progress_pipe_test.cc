#include "server/jobs/process/progress_pipe.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/io/forwarding_files.h"
#include "tests/support/temporary_folder.h"

namespace voxdag::server {
namespace {

using ::testing::HasSubstr;

// Counts the bytes on standard output, which is a file, at the first rename.
class RenameObserver : public ForwardingFiles {
 public:
  using ForwardingFiles::ForwardingFiles;
  void rename(const std::string& from, const std::string& to) override {
    struct stat output {};
    if (sent_bytes_ < 0 && fstat(STDOUT_FILENO, &output) == 0) sent_bytes_ = output.st_size;
    ForwardingFiles::rename(from, to);
  }
  int64_t sent_bytes() const { return sent_bytes_; }

 private:
  int64_t sent_bytes_ = -1;
};

// Clients request the list of subvolumes when they see the totals, so the list must exist then.
TEST(ProgressPipeTest, ListsSubvolumesBeforeItSendsTheirTotals) {
  const TemporaryFolder folder;
  RenameObserver files(system_files());
  testing::internal::CaptureStdout();
  {
    ProgressPipe pipe(files, folder.file("subvolumes.json"));
    pipe.set_subvolumes(1024, std::vector<SubvolumeStatus>{{7, {512, 0, 0}, 512, false, 0, 0, 0}});
  }
  EXPECT_THAT(testing::internal::GetCapturedStdout(), HasSubstr("\"message\":\"subvolumes\""));
  EXPECT_EQ(files.sent_bytes(), 0);
}

}  // namespace
}  // namespace voxdag::server
