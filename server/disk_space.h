// The free space on the data folder's disk: part of it stays free, and uploads reserve what they
// have announced, so that no two of them count on the same bytes. Thread-safe.
//
// A ballast file lies there for a disk that other programs fill to the last byte: without it the
// databases could not even record that something was deleted.
#pragma once

#include <cstdint>
#include <mutex>
#include <string>

#include "core/io/file_system.h"

namespace voxdag::server {

class DiskSpace {
 public:
  // `min_free_bytes` are not used, nor a little for the databases in any case. Drops the
  // ballast, since the databases need room to open.
  DiskSpace(FileSystem& files, const std::string& data_folder, uint64_t min_free_bytes);

  uint64_t free() const { return files_.free_space(folder_); }
  bool is_low() const { return free() < min_free_bytes_; }
  // What may still be used: neither to stay free nor reserved.
  uint64_t available() const;

  // The disk space of one upload, for as long as this exists. Used by one thread.
  class Reservation {
   public:
    // Throws Error{kNoSpace} if so much is not available.
    Reservation(DiskSpace& disk, uint64_t bytes);
    ~Reservation();
    Reservation(const Reservation&) = delete;
    // Call before writing so many bytes. Reserves more if more is written than was announced, and
    // throws Error{kNoSpace} if the disk is filling up in spite of the reservations.
    void use(uint64_t bytes);

   private:
    DiskSpace& disk_;
    uint64_t left_ = 0;
    uint64_t unchecked_ = 0;  // written since the disk was looked at
  };

  // Removes the ballast; false if there is none.
  bool drop_ballast();
  // Puts the ballast there again if there is room for it.
  void restore_ballast();

 private:
  void reserve(uint64_t bytes);

  FileSystem& files_;
  const std::string folder_;
  const uint64_t min_free_bytes_;
  mutable std::mutex mutex_;  // guards the next
  uint64_t reserved_bytes_ = 0;
};

}  // namespace voxdag::server
