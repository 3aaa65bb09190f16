// Artifacts that outlive their build: a cache entry is a file of one artifact, and any artifact of
// one subvolume can be copied into a segment for another cube of the same size, since hashes and
// indices do not depend on place or level. docs/format.md, "Cache entry", is the byte layout.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "core/format/artifact/artifact.h"

namespace voxdag {

// Appends the artifact that `from` holds at `ref` to `to`, as that of `cube` on a grid of
// 2^grid_levels voxels per edge. Frames are copied as they are, their checksums verified. Throws
// Error{kCorrupt} if it is damaged, not of one subvolume, or not of a cube of this size.
ArtifactRef copy_artifact(const ReadableFile& from, const ArtifactRef& ref, const Cube& cube,
                          uint32_t grid_levels, SegmentWriter& to);

// Writes the artifact at `ref` of `from` as a cache entry at `path`, whole or not at all: to
// `partial` first, a name of the caller's own, which is then renamed. Not synced: an entry that a
// power cut tears fails its checksums and is no more than a miss. Returns the bytes of the file.
uint64_t write_cache_entry(FileSystem& files, const std::string& path, const std::string& partial,
                           const ReadableFile& from, const ArtifactRef& ref);

struct CacheEntry {
  std::unique_ptr<ReadableFile> file;
  ArtifactRef ref;
  ArtifactRoot root;       // as it was built
  uint64_t dag_nodes = 0;  // of all its levels
};

// Throws Error{kCorrupt} or Error{kUnsupportedVersion}; kNotFound if there is none.
CacheEntry read_cache_entry(FileSystem& files, const std::string& path);

}  // namespace voxdag
