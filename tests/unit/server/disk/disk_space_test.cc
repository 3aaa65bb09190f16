#include "server/disk/disk_space.h"

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "core/io/forwarding_files.h"
#include "tests/support/temporary_folder.h"

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

// Simulates an upload of `bytes` bytes with this reservation, until the disk is full. Written bytes
// are no longer free. Returns the number of written bytes.
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

bool fits(DiskSpace& space, uint64_t announced) {
  try {
    DiskSpace::Reservation reservation(space, announced);
    return true;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kNoSpace);
    return false;
  }
}

// Uploads must leave 30 MiB of the disk free. An upload that declares more bytes than are free
// beyond these 30 MiB is refused when it begins. An upload of unknown size is stopped before it
// uses the 30 MiB.
TEST(DiskReservations, UploadsLeaveThePartOfTheDiskThatStaysFree) {
  const TemporaryFolder folder;
  SmallDisk disk;
  DiskSpace space(disk, folder.path(), 30 * kMiB);
  EXPECT_TRUE(fits(space, 70 * kMiB));
  EXPECT_FALSE(fits(space, 70 * kMiB + 1));
  {
    DiskSpace::Reservation whole(space, 70 * kMiB);
    EXPECT_EQ(fill(disk, whole, 70 * kMiB), 70 * kMiB) << "all that was announced fits";
    EXPECT_EQ(disk.free, 30 * kMiB);
    EXPECT_FALSE(fits(space, 1));
    EXPECT_FALSE(space.is_low());
  }
  disk.free = 90 * kMiB;
  DiskSpace::Reservation unknown(space, 0);
  const uint64_t written = fill(disk, unknown, 100 * kMiB);
  EXPECT_LE(written, 60 * kMiB);
  EXPECT_GT(written, 40 * kMiB);
  EXPECT_FALSE(space.is_low());
}

// A client that declares an upload as large as the disk but sends few bytes does not prevent other
// uploads, because only the space for its next bytes is reserved.
TEST(DiskReservations, UploadsThatSendSlowlyKeepNobodyOut) {
  const TemporaryFolder folder;
  SmallDisk disk;
  DiskSpace space(disk, folder.path(), 30 * kMiB);
  DiskSpace::Reservation slow(space, 70 * kMiB);
  EXPECT_EQ(fill(disk, slow, kMiB), kMiB);
  EXPECT_TRUE(fits(space, 60 * kMiB));
  DiskSpace::Reservation other(space, 62 * kMiB);
  EXPECT_EQ(fill(disk, other, 62 * kMiB), 62 * kMiB);
  EXPECT_EQ(fill(disk, slow, 7 * kMiB), 7 * kMiB) << "was reserved";
  EXPECT_EQ(fill(disk, slow, kMiB), 0u);
  EXPECT_EQ(disk.free, 30 * kMiB);
}

// When an upload ends, even unfinished, all space that it has reserved is released.
TEST(DiskReservations, UploadsGiveBackWhatTheyReserved) {
  const TemporaryFolder folder;
  SmallDisk disk;
  DiskSpace space(disk, folder.path(), 30 * kMiB);
  for (const uint64_t announced : {uint64_t{0}, kMiB, 20 * kMiB}) {
    DiskSpace::Reservation broken(space, announced);
    fill(disk, broken, 9 * kMiB);
    disk.free = 100 * kMiB;
  }
  EXPECT_TRUE(fits(space, 70 * kMiB));
}

// If other programs fill the disk during an upload, the upload stops.
TEST(DiskReservations, AnUploadStopsIfTheDiskFillsUp) {
  const TemporaryFolder folder;
  SmallDisk disk;
  DiskSpace space(disk, folder.path(), 30 * kMiB);
  DiskSpace::Reservation upload(space, 60 * kMiB);
  disk.free = 20 * kMiB;
  EXPECT_LE(fill(disk, upload, 60 * kMiB), 9 * kMiB);
}

TEST(DiskReservations, ABallastGivesRoomForDeletions) {
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

// The ballast is a file whose removal frees space on a full disk. If it cannot be written
// completely, it is removed, because an incomplete file would free too little.
TEST(DiskReservations, ABallastIsWholeOrAbsent) {
  class FailingDisk : public SmallDisk {
   public:
    class File : public ForwardingWriter {
     public:
      using ForwardingWriter::ForwardingWriter;
      void sync() override { throw Error(ErrorCode::kNoSpace, "the test's disk is full"); }
    };
    std::unique_ptr<WritableFile> create(const std::string& path) override {
      auto file = SmallDisk::create(path);
      if (fails) return std::make_unique<File>(std::move(file));
      return file;
    }
    bool fails = true;
  };
  const TemporaryFolder folder;
  FailingDisk disk;
  DiskSpace space(disk, folder.path(), 0);
  EXPECT_THROW(space.restore_ballast(), Error);
  EXPECT_FALSE(disk.exists(folder.file("ballast")));
  disk.fails = false;
  space.restore_ballast();
  EXPECT_TRUE(space.drop_ballast());
}

}  // namespace
}  // namespace voxdag::server
