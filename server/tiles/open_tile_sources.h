// Keeps the files open that viewers requested most recently, so that a request need not open and
// check them again. The next request for a replaced file closes the old file. close_stale() closes
// removed, replaced and idle files, so the owner must call it periodically. A file with an
// unreadable part is opened again. Manifests remain in memory longer than files remain open.
// Thread-safe.
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

  // Returns the file, opening it if necessary. Throws Error{kNotFound}, or the errors of
  // FileTileSource. A request that uses a file while close() closes it can finish.
  std::shared_ptr<const FileTileSource> open(const std::string& path);
  void close(const std::string& path);
  // Closes files that were removed or replaced, or were not requested for `max_idle_s`.
  void close_stale(double max_idle_s);
  size_t size() const;

 private:
  struct Entry {
    std::string path;
    std::shared_ptr<const FileTileSource> file;
    double used_s;
  };
  using Entries = std::list<Entry>;
  // Returns the entry of the file with this identity, and moves it to the front of the list; end()
  // if there is no such entry.
  Entries::iterator find(const std::string& path, const FileIdentity& identity);
  bool is_current(const Entry& entry) const;

  static constexpr size_t kMaxManifests = 256;

  FileSystem& files_;
  const size_t max_open_;
  mutable std::mutex mutex_;  // guards entries_
  Entries entries_;           // most recently used first
  const std::shared_ptr<ManifestCache> manifests_ = std::make_shared<ManifestCache>(kMaxManifests);
};

}  // namespace voxdag::server
