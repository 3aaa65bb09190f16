// A file of bytes that are read back by where they lie, each piece with a checksum of its own:
// triangles that memory did not take, or that are to outlive the process.
//
// append() and release() may be called by several threads at once, and read() beside them.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>

#include "core/base/error.h"
#include "core/io/file_system.h"

namespace voxdag {

// A piece of the file; one of no bytes is no piece.
struct Extent {
  uint64_t offset = 0;
  uint64_t bytes = 0;
  uint64_t checksum = 0;
};

// Error{kCorrupt}: the disk gave back other bytes than were written. What they were made of can be
// read again.
class DamagedTriangles : public Error {
 public:
  explicit DamagedTriangles(const std::string& what) : Error(ErrorCode::kCorrupt, what) {}
};

class TriangleFile {
 public:
  // Empty for `end` = 0; else goes on after the first `end` bytes of a file that has them.
  TriangleFile(FileSystem& files, std::string path, uint64_t end = 0);

  Extent append(std::span<const std::byte> bytes);
  // All of a piece; throws DamagedTriangles.
  void read(const Extent& extent, std::span<std::byte> out) const;
  // Gives back the space of a piece that nobody reads again.
  void release(const Extent& extent);
  // Returns once all that was appended, and the file's name, are on the disk.
  void sync();
  uint64_t end() const;
  uint64_t appended_bytes() const { return end() - first_; }

 private:
  FileSystem& files_;
  const std::string path_;
  std::unique_ptr<WritableFile> writer_;
  std::unique_ptr<ReadableFile> reader_;
  bool name_is_durable_;
  const uint64_t first_;
  mutable std::mutex mutex_;  // guards end_
  uint64_t end_;
};

}  // namespace voxdag
