// Manages the free space on the data folder's disk. Uploads leave a part of it free. An upload
// reserves space a few megabytes ahead of its writes. So two uploads never use the same free bytes,
// and a slow upload does not reserve the space of its complete scene. Thread-safe.
//
// A ballast file keeps some space for the service if other programs fill the disk. Without this
// space, the databases could not even record a deletion.
#pragma once

#include <cstdint>
#include <mutex>
#include <string>

#include "core/base/error.h"
#include "core/io/file_system.h"

namespace voxdag::server {

class DiskSpace {
 public:
  // Uploads leave `min_free_bytes` free, and at least a few megabytes for the databases. The
  // constructor removes an existing ballast, because the databases need space to open.
  DiskSpace(FileSystem& files, const std::string& data_folder, uint64_t min_free_bytes);

  uint64_t free() const { return files_.free_space(folder_); }
  bool is_low() const { return free() < min_free_bytes_; }
  // The disk space of one upload, reserved during the lifetime of this object. Used by one thread.
  class Reservation {
   public:
    // `announced`: the expected size of the upload in bytes, 0 if unknown. Throws Error{kNoSpace}
    // unless this much space is free in addition to the space that is kept free or already
    // reserved. At first reserves at most 8 MiB of this space. Other uploads can take the remaining
    // space before this upload reserves it.
    Reservation(DiskSpace& disk, uint64_t announced);
    ~Reservation();
    Reservation(const Reservation&) = delete;
    // Call this function before writing `bytes` bytes. If the reserved space is used up, reserves
    // more. Throws Error{kNoSpace} if too little space is free for this.
    void use(uint64_t bytes);

   private:
    DiskSpace& disk_;
    uint64_t left_;          // bytes that are reserved but not yet written
    uint64_t not_reserved_;  // bytes that are announced but not yet reserved
  };

  // Calls `act`, which deletes or cancels a job or scene. If `act` throws Error{kNoSpace}, removes
  // the ballast and calls `act` again. `act` must work even if its failed first call did a part of
  // the work.
  template <class Act>
  auto with_ballast(const Act& act) {
    try {
      return act();
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kNoSpace || !drop_ballast()) throw;
    }
    return act();
  }
  // Removes the ballast. Returns false if it does not exist.
  bool drop_ballast();
  // Restores the ballast if it is missing and at least 4 MiB are free.
  void restore_ballast();

 private:
  // Reserves `bytes`. Throws Error{kNoSpace} unless max(bytes, expected) bytes are free in addition
  // to min_free_bytes_ and reserved_bytes_.
  void reserve(uint64_t bytes, uint64_t expected);

  FileSystem& files_;
  const std::string folder_;
  const uint64_t min_free_bytes_;
  std::mutex mutex_;  // guards reserved_bytes_
  uint64_t reserved_bytes_ = 0;
  std::mutex ballast_mutex_;  // guards the ballast file
};

}  // namespace voxdag::server
