// A buffered output file of an export. The file has the name "<path>.partial" until publish(). The
// destructor removes a file that was not published. Used by one thread.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/file_system.h"
#include "core/io/temporary_paths.h"

namespace voxdag::query {

class ExportFile {
 public:
  ExportFile(FileSystem& files, const std::string& path);
  ExportFile(const ExportFile&) = delete;
  ExportFile& operator=(const ExportFile&) = delete;
  ~ExportFile();

  const std::string& path() const { return path_; }
  uint64_t size() const { return size_; }
  // Moves the write position to `offset`, which may be before or beyond the end of the file.
  void seek(uint64_t offset);
  void write(std::span<const std::byte> bytes);
  void write(std::string_view text) { write(std::as_bytes(std::span(text))); }
  template <class T>
  void put(T value) {
    write(std::as_bytes(std::span(&value, 1)));
  }

  // Makes the files durable and then renames them to their final names. Returns the total number of
  // bytes in the files.
  static uint64_t publish(std::span<ExportFile* const> written);

 private:
  void flush();

  FileSystem& files_;
  const std::string path_;
  std::unique_ptr<WritableFile> file_;
  std::vector<std::byte> buffer_;
  uint64_t buffer_offset_ = 0;  // offset of buffer_ in the file
  uint64_t size_ = 0;
  bool published_ = false;
  std::optional<TemporaryPath> registered_;  // registers the partial file until publish()
};

}  // namespace voxdag::query
