#include "scheduler/state/artifact_cache.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <vector>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/format/artifact/artifact_copy.h"
#include "core/format/checksum.h"

namespace voxdag {
namespace {

// Version of the artifacts, a part of every key. Increase it with every change that produces
// different artifacts from the same triangles.
constexpr uint64_t kContentVersion = 1;

using Corner = std::array<int64_t, 3>;
using Triangle = std::array<Corner, 3>;

// Returns the triangle relative to `low`, with its corners sorted. With `keeps_orientation`, the
// corners are rotated instead, so that the smallest corner is the first.
Triangle canonical(const FixedTriangle& triangle, const int64_t (&low)[3], bool keeps_orientation) {
  Triangle t;
  for (size_t i = 0; i < 3; ++i)
    for (size_t a = 0; a < 3; ++a) t[i][a] = triangle.v[i][a] - low[a];
  if (keeps_orientation)
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  else
    std::sort(t.begin(), t.end());
  return t;
}

template <class T>
void add_items(Sha256& digest, std::span<const T> items) {
  digest.add(std::as_bytes(items));
}

// Adds the data of a solid on which the voxels of a cube depend, except its triangles.
void add_solid(Sha256& digest, const SolidEntry& solid, uint32_t grid_levels) {
  const auto words = {static_cast<uint64_t>(solid.rule),
                      static_cast<uint64_t>(solid_block_log2(grid_levels))};
  add_items(digest, std::span<const uint64_t>(words));
  for (const std::vector<int32_t>& views : solid.views)
    add_items(digest, std::span<const int32_t>(views));
}

bool is_entry(const DirectoryEntry& entry) {
  return !entry.is_directory && entry.name.ends_with(".vdart");
}

bool is_partial(const DirectoryEntry& entry) {
  return !entry.is_directory && entry.name.find(".vdart.partial") != std::string::npos;
}

// Age at which a partial entry is removed. Writing an entry takes seconds, so the writer of an
// older partial entry no longer exists.
constexpr double kAbandonedAfterS = 3600;

}  // namespace

ArtifactCache::ArtifactCache(FileSystem& files, std::string folder, uint64_t limit_bytes)
    : files_(files), folder_(std::move(folder)), limit_bytes_(limit_bytes) {
  files_.make_directories(folder_);
  const double now_s = clock_seconds(CLOCK_REALTIME);
  for (const DirectoryEntry& entry : files_.list(folder_)) {
    if (is_entry(entry)) known_bytes_ += entry.bytes;
    if (is_partial(entry) && now_s - entry.modified_s > kAbandonedAfterS) remove(entry);
  }
}

std::string ArtifactCache::partial_of(const std::string& key) {
  return path_of(key) + ".partial-" + std::to_string(getpid()) + "-" + std::to_string(partials_++);
}

std::optional<std::string> ArtifactCache::key(const SubvolumeTask& task, TriangleStream& triangles,
                                              MemoryBudget& budget) {
  const bool is_solid = task.solid != nullptr;
  MemoryCharge charge;
  std::vector<Triangle> content;
  try {
    charge = MemoryCharge(budget, triangles.count() * sizeof(Triangle), "a content key");
  } catch (const Error&) {
    return std::nullopt;
  }
  content.reserve(triangles.count());
  const int64_t edge_units = task.cube.edge_voxels(task.grid_levels) * kUnitsPerVoxel;
  int64_t low[3];
  for (int a = 0; a < 3; ++a) low[a] = static_cast<int64_t>(task.cube.position[a]) * edge_units;
  triangles.rewind();
  std::array<FixedTriangle, 256> batch;
  while (const size_t n = triangles.read(batch))
    for (size_t i = 0; i < n; ++i) content.push_back(canonical(batch[i], low, is_solid));
  std::sort(content.begin(), content.end());
  if (!is_solid) content.erase(std::unique(content.begin(), content.end()), content.end());

  Sha256 digest;
  const uint64_t head[] = {kContentVersion, task.grid_levels - task.cube.level, task.hash_bits};
  digest.add(std::as_bytes(std::span(head)));
  if (task.rule != VoxelRule::kShell)
    digest.add(std::as_bytes(std::span(std::string_view(traits_of(task.rule).name))));
  if (is_solid) add_solid(digest, *task.solid, task.grid_levels);
  digest.add(std::as_bytes(std::span(content)));
  triangles.rewind();
  return digest.finish();
}

bool ArtifactCache::find(const std::string& key, const SubvolumeTask& task,
                         StoredSubvolume& subvolume, SegmentWriter& segment) {
  try {
    const CacheEntry entry = read_cache_entry(files_, path_of(key), key, task.solid != nullptr);
    subvolume.artifact =
        copy_artifact(*entry.file, entry.ref, subvolume.cube, task.grid_levels, segment);
    subvolume.summary = {entry.root.voxels, entry.root.svo_nodes, entry.dag_nodes,
                         entry.root.hash,   entry.solid.interior, entry.solid.disputed};
    mark_used(key);
    return true;
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kNoSpace)
      throw;  // the segment's disk is full, not the cache's disk
    return false;
  }
}

void ArtifactCache::mark_used(const std::string& key) {
  try {
    files_.touch(path_of(key));
  } catch (const Error&) {
    // This process has no permission to write to the cache.
  }
}

void ArtifactCache::add(const std::string& key, const SubvolumeTask& task,
                        const ReadableFile& segment, const StoredSubvolume& built) {
  std::optional<SolidCounts> solid;
  if (task.solid != nullptr) solid = {built.summary.interior, built.summary.disputed};
  try {
    const std::string partial = partial_of(key);
    uint64_t bytes = 0;
    try {
      bytes = write_cache_entry(files_, path_of(key), partial, key, segment, built.artifact, solid);
    } catch (const Error&) {
      files_.remove(partial);
      throw;
    }
    std::lock_guard lock(mutex_);
    known_bytes_ += bytes;
    if (known_bytes_ > limit_bytes_) evict();
  } catch (const Error&) {
    // The build does not need the cache entry.
  }
}

void ArtifactCache::evict() {
  std::vector<DirectoryEntry> entries = files_.list(folder_);
  std::erase_if(entries, [](const DirectoryEntry& entry) { return !is_entry(entry); });
  std::sort(entries.begin(), entries.end(), [](const DirectoryEntry& a, const DirectoryEntry& b) {
    return a.modified_s < b.modified_s;
  });
  known_bytes_ = 0;
  for (const DirectoryEntry& entry : entries) known_bytes_ += entry.bytes;
  for (const DirectoryEntry& entry : entries) {
    if (known_bytes_ <= limit_bytes_ / 10 * 9) return;
    known_bytes_ -= entry.bytes;
    remove(entry);
  }
}

void ArtifactCache::remove(const DirectoryEntry& entry) {
  try {
    files_.remove(folder_ + "/" + entry.name);
  } catch (const Error&) {
    // Another build has already removed the entry.
  }
}

}  // namespace voxdag
