#include "server/disk_space.h"

#include <algorithm>

#include "core/base/error.h"

namespace voxdag::server {
namespace {

constexpr uint64_t kForDatabases = uint64_t{4} << 20;
constexpr uint64_t kBallastBytes = uint64_t{1} << 20;
// How much an upload may write between two looks at the disk, and reserves at a time if it did not
// announce its size.
constexpr uint64_t kStepBytes = uint64_t{8} << 20;

std::string ballast_of(const std::string& folder) { return folder + "/ballast"; }

}  // namespace

DiskSpace::DiskSpace(FileSystem& files, const std::string& data_folder, uint64_t min_free_bytes)
    : files_(files),
      folder_(data_folder),
      min_free_bytes_(std::max(min_free_bytes, kForDatabases)) {
  drop_ballast();
}

uint64_t DiskSpace::available() const {
  std::lock_guard lock(mutex_);
  const uint64_t taken = min_free_bytes_ + reserved_bytes_, now = free();
  return now > taken ? now - taken : 0;
}

void DiskSpace::reserve(uint64_t bytes) {
  std::lock_guard lock(mutex_);
  if (free() < min_free_bytes_ + reserved_bytes_ + bytes)
    throw Error(ErrorCode::kNoSpace, folder_ + ": the disk has not enough free space for " +
                                         std::to_string(bytes) + " more bytes");
  reserved_bytes_ += bytes;
}

DiskSpace::Reservation::Reservation(DiskSpace& disk, uint64_t bytes) : disk_(disk) {
  disk_.reserve(bytes);
  left_ = bytes;
}

DiskSpace::Reservation::~Reservation() {
  std::lock_guard lock(disk_.mutex_);
  disk_.reserved_bytes_ -= left_;
}

void DiskSpace::Reservation::use(uint64_t bytes) {
  if (bytes > left_) {
    const uint64_t more = std::max(kStepBytes, bytes - left_);
    disk_.reserve(more);
    left_ += more;
  }
  unchecked_ += bytes;
  if (unchecked_ > kStepBytes) {
    unchecked_ = 0;
    if (disk_.is_low())
      throw Error(ErrorCode::kNoSpace, disk_.folder_ + ": the disk is filling up");
  }
  std::lock_guard lock(disk_.mutex_);
  left_ -= bytes;
  disk_.reserved_bytes_ -= bytes;
}

bool DiskSpace::drop_ballast() {
  if (!files_.exists(ballast_of(folder_))) return false;
  files_.remove(ballast_of(folder_));
  return true;
}

void DiskSpace::restore_ballast() {
  if (files_.exists(ballast_of(folder_)) || free() < kForDatabases) return;
  const auto file = files_.create(ballast_of(folder_));
  file->write_at(0, std::vector<std::byte>(kBallastBytes, std::byte{1}));
  file->close();
}

}  // namespace voxdag::server
