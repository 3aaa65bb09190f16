// Files of the data folder other than the stores, and their deletion. Only files marked by the
// service are ever removed. So no file is lost if a store is lost or restored from a backup.
#pragma once

#include <cstdint>
#include <string>

#include "core/io/file_system.h"

namespace voxdag::server {

// Suffix of names whose deletion has begun. Scenes and jobs never have such a name.
inline constexpr const char* kDeleted = ".deleted";

// True if the folder exists and is not empty.
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
