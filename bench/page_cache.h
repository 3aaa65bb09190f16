// Files that are not in memory, for the benchmarks.
#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <string>

namespace voxdag {

// Drops the pages of a file from the system's page cache, except pages that a process has mapped.
inline void drop_from_page_cache(const std::string& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return;
  posix_fadvise(fd, 0, 0, POSIX_FADV_DONTNEED);
  ::close(fd);
}

}  // namespace voxdag
