// Helpers for the files in the data folder. The service removes a scene or a job only after it has
// marked the file or folder by renaming it. It never removes an unmarked file that no database
// lists. So no file is lost if a database is lost or restored from a backup.
#pragma once

#include <cstdint>
#include <string>

#include "core/io/file_system.h"

namespace voxdag::server {

// Suffix of the name of a file or folder whose deletion has begun. Scenes and jobs never have a
// name with this suffix.
inline constexpr const char* kDeleted = ".deleted";

// True if the folder exists and is not empty.
bool has_entries(FileSystem& files, const std::string& path);

// Detects that a file in use was removed or replaced under its name.
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
