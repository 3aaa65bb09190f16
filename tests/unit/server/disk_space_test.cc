#include "server/disk_space.h"

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/io/forwarding_files.h"
#include "tests/unit/io/temporary_folder.h"

namespace voxdag::server {
namespace {

constexpr uint64_t kMiB = uint64_t{1} << 20;

// A disk whose free space the test sets.
class SmallDisk : public ForwardingFiles {
 public:
  SmallDisk() : ForwardingFiles(system_files()) {}
  uint64_t free_space(const std::string&) override { return free; }
  uint64_t free = 100 * kMiB;
};

// Writes as much as the disk takes; what is written is not free any more.
uint64_t fill(SmallDisk& disk, DiskSpace::Reservation& space, uint64_t bytes) {
  constexpr uint64_t kPiece = kMiB / 4;
  uint64_t written = 0;
  try {
    for (; written < bytes; written += kPiece) {
      space.use(kPiece);
      disk.free -= kPiece;
    }
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kNoSpace);
  }
  return written;
}

// Uploads whose sum is too much are refused when they begin, and one of unknown size when the part
// of the disk that stays free is reached.
TEST(Hardening, M1_UploadsReserveWhatTheyAnnounce) {
  const TemporaryFolder folder;
  SmallDisk disk;
  DiskSpace space(disk, folder.path(), 30 * kMiB);
  EXPECT_EQ(space.available(), 70 * kMiB);
  {
    DiskSpace::Reservation first(space, 40 * kMiB);
    EXPECT_EQ(space.available(), 30 * kMiB);
    EXPECT_THROW(DiskSpace::Reservation(space, 31 * kMiB), Error);
    EXPECT_EQ(fill(disk, first, 10 * kMiB), 10 * kMiB);
    EXPECT_EQ(space.available(), 30 * kMiB) << "written bytes are not reserved twice";
    EXPECT_EQ(disk.free, 90 * kMiB);
  }
  EXPECT_EQ(space.available(), 60 * kMiB) << "what was not sent is free again";
  DiskSpace::Reservation unknown(space, 0);
  const uint64_t written = fill(disk, unknown, 100 * kMiB);
  EXPECT_LE(written, 60 * kMiB);
  EXPECT_GT(written, 40 * kMiB);
  EXPECT_FALSE(space.is_low());
}

// Others write to the disk, too.
TEST(Hardening, M1_AnUploadStopsIfTheDiskFillsUp) {
  const TemporaryFolder folder;
  SmallDisk disk;
  DiskSpace space(disk, folder.path(), 30 * kMiB);
  DiskSpace::Reservation upload(space, 60 * kMiB);
  disk.free = 20 * kMiB;
  EXPECT_LE(fill(disk, upload, 60 * kMiB), 9 * kMiB);
}

TEST(Hardening, M1_ABallastGivesRoomForDeletions) {
  const TemporaryFolder folder;
  SmallDisk disk;
  disk.free = 0;
  DiskSpace space(disk, folder.path(), 0);
  space.restore_ballast();
  EXPECT_FALSE(space.drop_ballast()) << "there was no room";
  disk.free = 100 * kMiB;
  space.restore_ballast();
  EXPECT_TRUE(disk.exists(folder.file("ballast")));
  EXPECT_TRUE(space.drop_ballast());
  EXPECT_FALSE(space.drop_ballast());
  space.restore_ballast();
  const DiskSpace next(disk, folder.path(), 0);
  EXPECT_FALSE(disk.exists(folder.file("ballast"))) << "the databases need room to open";
}

}  // namespace
}  // namespace voxdag::server
