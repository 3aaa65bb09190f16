// Writes a .glb file: header, JSON chunk and BIN chunk, through one buffer. The file has the name
// "<path>.partial" until finish() renames it. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/io/file_system.h"
#include "core/io/temporary_paths.h"

namespace voxdag {

inline constexpr uint64_t kMaxGlbBytes = UINT32_MAX;

class GlbFile {
 public:
  // Writes the header and `json` immediately. `bin_bytes`, a multiple of 4, is the size of the BIN
  // chunk. Throws Error{kLimit} if the file would be larger than kMaxGlbBytes.
  GlbFile(FileSystem& files, const std::string& path, std::string json, uint64_t bin_bytes);
  // Removes the partial file unless it is finished.
  ~GlbFile();
  GlbFile(const GlbFile&) = delete;

  // Appends to the BIN chunk.
  void put(const void* data, size_t bytes);
  // Syncs and closes the file, which keeps the name "<path>.partial". Returns its size.
  uint64_t finish_partial();
  // Syncs the file, renames it and syncs the folder. Returns the size of the file.
  uint64_t finish();

 private:
  void put_u32(uint64_t value);
  void flush();
  void sync_and_close();

  FileSystem& files_;
  const std::string path_;
  std::unique_ptr<WritableFile> file_;
  std::vector<std::byte> buffer_;
  uint64_t written_ = 0;
  bool finished_ = false;
  std::optional<TemporaryPath> registered_;  // registers the partial file until finish()
};

// True if the file is a .glb whose JSON contains the text `generator`.
bool is_glb_of(const ReadableFile& file, const std::string& generator);

}  // namespace voxdag
