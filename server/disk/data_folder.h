// What the data folder holds besides the stores, and how it is deleted: only what the service
// marked itself is ever removed, so that a store that was lost or restored from a backup costs no
// file.
#pragma once

#include <cstdint>
#include <string>

#include "core/io/file_system.h"

namespace voxdag::server {

// The name that something has once its deletion has begun. No scene and no job has such a name.
inline constexpr const char* kDeleted = ".deleted";

// Whether a folder exists and has any entry.
bool has_entries(FileSystem& files, const std::string& path);

// A file that must stay under its name while it is open.
class NamedFile {
 public:
  explicit NamedFile(const std::string& path);
  // Throws Error{kIo} if the file was removed or replaced: what is written now would be lost.
  void check() const;

 private:
  const std::string path_;
  const uint64_t inode_;
};

}  // namespace voxdag::server
