// Caches the open files of viewers, so that a request need not open and check its file again: the
// few most recently requested. A removed or replaced file is closed at its next request, by
// close(), or by close_stale(), which must be called periodically. A file with an unreadable part
// is opened again. The cache keeps manifests longer than files. Thread-safe.
#pragma once

#include <list>
#include <memory>
#include <mutex>
#include <string>

#include "core/io/file_system.h"
#include "server/tiles/file_tile_source.h"

namespace voxdag::server {

class OpenTileSources {
 public:
  OpenTileSources(FileSystem& files, size_t max_open) : files_(files), max_open_(max_open) {}

  // Throws Error{kNotFound}, or as FileTileSource. Requests that still use a file that is closed
  // finish.
  std::shared_ptr<const FileTileSource> open(const std::string& path);
  void close(const std::string& path);
  // Closes files that were removed or replaced, or not requested for `max_idle_s`.
  void close_stale(double max_idle_s);
  size_t size() const;

 private:
  struct Entry {
    std::string path;
    std::shared_ptr<const FileTileSource> file;
    double used_s;
  };
  using Entries = std::list<Entry>;
  // The entry of a file with this identity, moved to the front, or end().
  Entries::iterator find(const std::string& path, const FileIdentity& identity);
  bool is_current(const Entry& entry) const;

  static constexpr size_t kMaxManifests = 256;

  FileSystem& files_;
  const size_t max_open_;
  mutable std::mutex mutex_;  // guards the next
  Entries entries_;           // used last first
  const std::shared_ptr<ManifestCache> manifests_ = std::make_shared<ManifestCache>(kMaxManifests);
};

}  // namespace voxdag::server
