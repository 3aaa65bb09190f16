#include "server/jobs/process/job_folder.h"

namespace voxdag::server {

void remove_tree(FileSystem& files, const std::string& path) {
  if (!files.exists(path)) return;
  for (const DirectoryEntry& entry : files.list(path)) {
    const std::string inner = path + "/" + entry.name;
    if (entry.is_directory)
      remove_tree(files, inner);
    else
      files.remove(inner);
  }
  files.remove_directory(path);
}

}  // namespace voxdag::server
