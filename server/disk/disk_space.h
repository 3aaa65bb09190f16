// The free space on the data folder's disk. A reserve is kept free, and uploads reserve a few
// megabytes ahead of their writes. So no two uploads count on the same bytes, and a slow upload
// does not exclude others. Thread-safe.
//
// A ballast file protects against other programs that fill the disk to the last byte: without it
// the databases could not even record a deletion.
#pragma once

#include <cstdint>
#include <mutex>
#include <string>

#include "core/base/error.h"
#include "core/io/file_system.h"

namespace voxdag::server {

class DiskSpace {
 public:
  // `min_free_bytes` are not used, nor a little for the databases in any case. Drops the
  // ballast, since the databases need room to open.
  DiskSpace(FileSystem& files, const std::string& data_folder, uint64_t min_free_bytes);

  uint64_t free() const { return files_.free_space(folder_); }
  bool is_low() const { return free() < min_free_bytes_; }
  // The disk space of one upload, for as long as this exists. Used by one thread.
  class Reservation {
   public:
    // `announced` bytes are to come, 0 if that is not known. Throws Error{kNoSpace} if they do not
    // fit now; others may still take the space before they come.
    Reservation(DiskSpace& disk, uint64_t announced);
    ~Reservation();
    Reservation(const Reservation&) = delete;
    // Call before writing so many bytes. Reserves more when they are used up; throws
    // Error{kNoSpace} if the disk is full by then.
    void use(uint64_t bytes);

   private:
    DiskSpace& disk_;
    uint64_t left_;          // reserved, not yet written
    uint64_t not_reserved_;  // announced, not yet reserved
  };

  // Calls `act`, which deletes or cancels something. If the disk has no space to record that, which
  // it may have done in part, it is called again without the ballast.
  template <class Act>
  auto with_ballast(const Act& act) {
    try {
      return act();
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kNoSpace || !drop_ballast()) throw;
    }
    return act();
  }
  // Removes the ballast; false if it does not exist.
  bool drop_ballast();
  // Restores the ballast if the disk has space for it.
  void restore_ballast();

 private:
  // Throws Error{kNoSpace} if the larger of both is not free; reserves `bytes`.
  void reserve(uint64_t bytes, uint64_t expected);

  FileSystem& files_;
  const std::string folder_;
  const uint64_t min_free_bytes_;
  std::mutex mutex_;  // guards the next
  uint64_t reserved_bytes_ = 0;
  std::mutex ballast_mutex_;  // guards the ballast
};

}  // namespace voxdag::server
