#include "server/disk/data_folder.h"

#include <sys/stat.h>

#include "core/base/error.h"

namespace voxdag::server {
namespace {

// Returns the inode of the file; 0 if none exists.
uint64_t inode_of(const std::string& path) {
  struct stat found {};
  return stat(path.c_str(), &found) == 0 ? found.st_ino : 0;
}

}  // namespace

bool has_entries(FileSystem& files, const std::string& path) {
  return files.exists(path) && !files.list(path).empty();
}

NamedFile::NamedFile(const std::string& path) : path_(path), inode_(inode_of(path)) {}

void NamedFile::check() const {
  if (inode_of(path_) != inode_)
    throw Error(ErrorCode::kIo, path_ +
                                    ": the file was removed or replaced while it is in use: "
                                    "restore it and restart the service");
}

}  // namespace voxdag::server
