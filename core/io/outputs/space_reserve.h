// A file system that leaves a part of the disk free for others. Writes that would use this part
// fail with Error{kNoSpace}, as on a full disk. Thread-safe.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include "core/io/forwarding_files.h"

namespace voxdag {

class SpaceReserve : public ForwardingFiles {
 public:
  // Leaves `reserve_bytes` free on each disk that has files of this object.
  SpaceReserve(FileSystem& files, uint64_t reserve_bytes)
      : ForwardingFiles(files), reserve_bytes_(reserve_bytes) {}

  std::unique_ptr<WritableFile> create(const std::string& path) override;
  std::unique_ptr<WritableFile> open_write(const std::string& path) override;
  // Returns the free bytes of the disk minus the reserve.
  uint64_t free_space(const std::string& path) override;

 private:
  class Writer;
  std::unique_ptr<WritableFile> wrap(std::unique_ptr<WritableFile> file);
  // Throws Error{kNoSpace} if `bytes` more bytes at `path` would use the reserve.
  void use(const std::string& path, uint64_t bytes);

  const uint64_t reserve_bytes_;
  std::atomic<uint64_t> unchecked_bytes_{UINT64_MAX / 2};  // bytes written since the last check
};

}  // namespace voxdag
