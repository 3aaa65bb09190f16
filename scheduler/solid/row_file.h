// A file of compressed rows (row_codec.h). The caller keeps the extents of its rows; the file does
// not list them. Thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "core/io/file_system.h"

namespace voxdag {

// The position, size and checksum of some bytes in a file.
struct RowExtent {
  uint64_t offset = 0, bytes = 0, checksum = 0;
};

class RowFile {
 public:
  // Opens `path` to append from offset `first_byte`. Keeps the bytes before it.
  RowFile(FileSystem& files, const std::string& path, uint64_t first_byte);

  RowExtent append(std::span<const std::byte> bytes);
  // Compresses `numbers` and appends the compressed bytes.
  RowExtent append_rows(std::span<const int32_t> numbers);
  // read() and read_rows() throw Error{kCorrupt} if the bytes are damaged.
  std::vector<std::byte> read(const RowExtent& extent) const;
  void read_rows(const RowExtent& extent, std::span<int32_t> out) const;
  const std::string& path() const { return path_; }
  WritableFile& file() { return *file_; }
  uint64_t end() const;

 private:
  const std::string path_;
  const std::unique_ptr<WritableFile> file_;
  const std::unique_ptr<ReadableFile> reader_;
  mutable std::mutex mutex_;
  uint64_t end_;
};

// Returns the bytes of an extent. Throws Error{kCorrupt} if they are damaged.
std::vector<std::byte> read_extent(const ReadableFile& file, const RowExtent& extent);

}  // namespace voxdag
