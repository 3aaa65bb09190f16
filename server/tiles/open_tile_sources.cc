#include "server/tiles/open_tile_sources.h"

#include <algorithm>

#include "core/base/clock.h"
#include "core/base/error.h"

namespace voxdag::server {

std::shared_ptr<const FileTileSource> OpenTileSources::open(const std::string& path) {
  const FileIdentity identity = files_.open_own(path)->identity();
  {
    const std::lock_guard lock(mutex_);
    if (const auto found = find(path, identity); found != entries_.end()) return found->file;
  }
  // Opens the file while the mutex is not locked, so that requests for other files need not wait
  // for this file's disk.
  auto file = std::make_shared<const FileTileSource>(path, identity, manifests_);
  const std::lock_guard lock(mutex_);
  // If another request has opened the same file in the meantime, uses that request's object. So the
  // manifest is computed, and the blocks are verified, only once.
  if (const auto found = find(path, identity); found != entries_.end()) return found->file;
  entries_.remove_if([&](const Entry& e) { return e.path == path; });
  entries_.push_front({path, file, wall_seconds()});
  if (entries_.size() > max_open_) entries_.pop_back();
  return file;
}

OpenTileSources::Entries::iterator OpenTileSources::find(const std::string& path,
                                                         const FileIdentity& identity) {
  const auto found = std::find_if(entries_.begin(), entries_.end(), [&](const Entry& e) {
    return e.path == path && e.file->identity() == identity && !e.file->is_broken();
  });
  if (found == entries_.end()) return found;
  found->used_s = wall_seconds();
  entries_.splice(entries_.begin(), entries_, found);
  return found;
}

void OpenTileSources::close(const std::string& path) {
  const std::lock_guard lock(mutex_);
  entries_.remove_if([&](const Entry& e) { return e.path == path; });
}

void OpenTileSources::close_stale(double max_idle_s) {
  const std::lock_guard lock(mutex_);
  const double oldest_s = wall_seconds() - max_idle_s;
  entries_.remove_if([&](const Entry& e) { return e.used_s < oldest_s || !is_current(e); });
}

size_t OpenTileSources::size() const {
  const std::lock_guard lock(mutex_);
  return entries_.size();
}

bool OpenTileSources::is_current(const Entry& entry) const {
  try {
    return !entry.file->is_broken() &&
           files_.open_own(entry.path)->identity() == entry.file->identity();
  } catch (const Error&) {
    return false;
  }
}

}  // namespace voxdag::server
