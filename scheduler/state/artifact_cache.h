// Artifacts shared between builds. If the content of a subvolume was built before, in any place of
// any grid, its artifact is copied instead of built.
//
// The key is the SHA-256 of the canonical content. The content has the snapped triangles relative
// to the cube. The corners within each triangle are sorted, the triangles are sorted, and
// duplicates are removed. The content also has the cube's edge, the hash bits, the voxel rule, and
// a version that increases whenever artifacts change. For a solid, the triangles keep their
// orientation and their duplicates, and the content has the rule of the solid and the views from
// the low faces of the cube (SolidEntry). The views are the only data from outside the cube on
// which the voxels of a subvolume depend. The cache is a folder with one file per entry. When the
// limit is exceeded, the least recently used entries are removed. Several builds may share the
// cache: entries appear atomically, by renaming, and a removed or damaged entry is a miss.
// Thread-safe.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>

#include "core/backend/backend.h"
#include "core/format/artifact/segment_writer.h"
#include "core/io/file_system.h"
#include "scheduler/state/job_store.h"

namespace voxdag {

class ArtifactCache {
 public:
  ArtifactCache(FileSystem& files, std::string folder, uint64_t limit_bytes);

  // Returns the key of a subvolume; nullopt if its triangles do not fit `budget`. Such a subvolume
  // is not cached.
  static std::optional<std::string> key(const SubvolumeTask& task, TriangleStream& triangles,
                                        MemoryBudget& budget);
  // Copies the entry of `key` into `segment` and fills in the subvolume's artifact and summary.
  // Returns false if the entry is missing or damaged.
  bool find(const std::string& key, const SubvolumeTask& task, StoredSubvolume& subvolume,
            SegmentWriter& segment);
  // Adds the built subvolume, whose artifact is flushed in `segment`. Errors are ignored, because
  // the cache is optional.
  void add(const std::string& key, const SubvolumeTask& task, const ReadableFile& segment,
           const StoredSubvolume& built);

 private:
  std::string path_of(const std::string& key) const { return folder_ + "/" + key + ".vdart"; }
  // Returns a temporary name that no other writer uses, in this process or another.
  std::string partial_of(const std::string& key);
  void mark_used(const std::string& key);
  // Removes the least recently used entries until the cache takes at most nine tenths of the limit.
  void evict();
  void remove(const DirectoryEntry& entry);

  FileSystem& files_;
  const std::string folder_;
  const uint64_t limit_bytes_;
  std::mutex mutex_;          // guards known_bytes_
  uint64_t known_bytes_ = 0;  // size of the entries at the last listing, plus entries added since
  std::atomic<uint64_t> partials_{0};
};

}  // namespace voxdag
