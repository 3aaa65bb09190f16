// Files of the data folder other than the stores, and their deletion. Only files that the service
// marked are ever removed, so a store that was lost or restored from a backup costs no file.
#pragma once

#include <cstdint>
#include <string>

#include "core/io/file_system.h"

namespace voxdag::server {

// The name that something has once its deletion has begun. No scene and no job has such a name.
inline constexpr const char* kDeleted = ".deleted";

// True if a folder exists and has any entry.
bool has_entries(FileSystem& files, const std::string& path);

// A file that must keep its name while it is open.
class NamedFile {
 public:
  explicit NamedFile(const std::string& path);
  // Throws Error{kIo} if the file was removed or replaced, because further writes would be lost.
  void check() const;

 private:
  const std::string path_;
  const uint64_t inode_;
};

}  // namespace voxdag::server
