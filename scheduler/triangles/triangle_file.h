// An append-only file of pieces that are read by offset. Each piece has a checksum. Holds triangles
// that do not fit in memory or that outlive the process.
//
// append(), read() and release() are thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>

#include "core/base/error.h"
#include "core/io/file_system.h"

namespace voxdag {

// A piece of the file. An extent with `bytes` == 0 means "no piece".
struct Extent {
  uint64_t offset = 0;
  uint64_t bytes = 0;
  uint64_t checksum = 0;
};

// Error{kCorrupt} about stored triangles. It is a separate type because the build can recover from
// it by reading the scene again.
class DamagedTriangles : public Error {
 public:
  explicit DamagedTriangles(const std::string& what) : Error(ErrorCode::kCorrupt, what) {}
};

class TriangleFile {
 public:
  // Creates the file if `end` is 0; otherwise opens it to append after its first `end` bytes.
  // Throws DamagedTriangles for a shorter file.
  TriangleFile(FileSystem& files, std::string path, uint64_t end = 0);

  Extent append(std::span<const std::byte> bytes);
  // Reads a piece; `out` must have its size. Throws DamagedTriangles if the file is too short or
  // the checksum differs.
  void read(const Extent& extent, std::span<std::byte> out) const;
  // Frees the disk space of a piece that is no longer needed.
  void release(const Extent& extent);
  // Makes all appended pieces and the file's directory entry durable.
  void sync();
  uint64_t end() const;
  // Bytes appended since the file was opened.
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
