#include "server/disk/disk_space.h"

#include <algorithm>

#include "core/base/error.h"
#include "core/base/text.h"

namespace voxdag::server {
namespace {

constexpr uint64_t kForDatabases = uint64_t{4} << 20;  // minimum free space that uploads leave
constexpr uint64_t kBallastBytes = uint64_t{1} << 20;  // size of the ballast file (disk_space.h)
// Bytes that an upload reserves in one step.
constexpr uint64_t kStepBytes = uint64_t{8} << 20;

std::string ballast_of(const std::string& folder) { return folder + "/ballast"; }

}  // namespace

DiskSpace::DiskSpace(FileSystem& files, const std::string& data_folder, uint64_t min_free_bytes)
    : files_(files),
      folder_(data_folder),
      min_free_bytes_(std::max(min_free_bytes, kForDatabases)) {
  drop_ballast();
}

void DiskSpace::reserve(uint64_t bytes, uint64_t expected) {
  std::lock_guard lock(mutex_);
  const uint64_t needed = std::max(bytes, expected);
  const uint64_t free_bytes = free(), kept = min_free_bytes_ + reserved_bytes_;
  if (free_bytes < kept + needed)
    throw Error(ErrorCode::kNoSpace, folder_ + ": the disk has not enough free space for " +
                                         size_text(needed) + " more: " + size_text(free_bytes) +
                                         " are free, expected " + size_text(kept + needed) +
                                         ", because " + size_text(kept) + " are reserved");
  reserved_bytes_ += bytes;
}

DiskSpace::Reservation::Reservation(DiskSpace& disk, uint64_t announced)
    : disk_(disk), left_(std::min(announced, kStepBytes)), not_reserved_(announced - left_) {
  disk_.reserve(left_, announced);
}

DiskSpace::Reservation::~Reservation() {
  std::lock_guard lock(disk_.mutex_);
  disk_.reserved_bytes_ -= left_;
}

void DiskSpace::Reservation::use(uint64_t bytes) {
  if (bytes > left_) {
    const uint64_t ahead = not_reserved_ > 0 ? std::min(not_reserved_, kStepBytes) : kStepBytes;
    const uint64_t more = std::max(ahead, bytes - left_);
    disk_.reserve(more, 0);
    left_ += more;
    not_reserved_ -= std::min(not_reserved_, more);
  }
  std::lock_guard lock(disk_.mutex_);
  left_ -= bytes;
  disk_.reserved_bytes_ -= bytes;
}

bool DiskSpace::drop_ballast() {
  std::lock_guard lock(ballast_mutex_);
  if (!files_.exists(ballast_of(folder_))) return false;
  files_.remove(ballast_of(folder_));
  return true;
}

void DiskSpace::restore_ballast() {
  std::lock_guard lock(ballast_mutex_);
  if (files_.exists(ballast_of(folder_)) || free() < kForDatabases) return;
  const auto file = files_.create(ballast_of(folder_));
  try {
    file->write_at(0, std::vector<std::byte>(kBallastBytes, std::byte{1}));
    file->sync();
    file->close();
  } catch (...) {
    files_.remove(ballast_of(folder_));  // a part of the ballast would not be enough
    throw;
  }
}

}  // namespace voxdag::server
