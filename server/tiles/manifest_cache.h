// Caches the most recently used manifests by digest. The cache outlives the open files, because
// computing the cameras of a manifest takes longer than reopening a file. Thread-safe.
#pragma once

#include <list>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

namespace voxdag::server {

class ManifestCache {
 public:
  explicit ManifestCache(size_t max) : max_(max) {}

  std::optional<std::string> find(const std::string& digest) {
    const std::lock_guard lock(mutex_);
    for (auto entry = entries_.begin(); entry != entries_.end(); ++entry) {
      if (entry->first != digest) continue;
      entries_.splice(entries_.begin(), entries_, entry);
      return entry->second;
    }
    return std::nullopt;
  }
  void keep(const std::string& digest, const std::string& manifest) {
    const std::lock_guard lock(mutex_);
    entries_.remove_if([&](const auto& entry) { return entry.first == digest; });
    entries_.emplace_front(digest, manifest);
    if (entries_.size() > max_) entries_.pop_back();
  }

 private:
  const size_t max_;
  std::mutex mutex_;                                        // guards entries_
  std::list<std::pair<std::string, std::string>> entries_;  // most recently used first
};

}  // namespace voxdag::server
