// Copies artifacts between builds. A cache entry is a file of one artifact. An artifact of one
// subvolume can be copied into a segment for another cube of the same size, since hashes and
// indices depend neither on place nor on level. docs/format.md, "Cache entry", is the byte layout.
#pragma once

#include <memory>
#include <string>

#include "core/format/artifact/segment_writer.h"

namespace voxdag {

// Appends the artifact at `ref` in `from` to `to`, as the artifact of `cube` on a grid of
// 2^grid_levels voxels per edge. The checksums of the frames are verified. Throws Error{kCorrupt}
// if the artifact is damaged, not of one subvolume, or not of a cube of this size.
ArtifactRef copy_artifact(const ReadableFile& from, const ArtifactRef& ref, const Cube& cube,
                          uint32_t grid_levels, SegmentWriter& to);

// Writes the artifact at `ref` of `from` as a cache entry at `path`, whole or not at all: first to
// `partial`, a name that only the caller uses, which is then renamed. The file is not synced: an
// entry that a power failure damages fails its checksums and is a cache miss. Returns the size of
// the file in bytes.
uint64_t write_cache_entry(FileSystem& files, const std::string& path, const std::string& partial,
                           const ReadableFile& from, const ArtifactRef& ref);

struct CacheEntry {
  std::unique_ptr<ReadableFile> file;
  ArtifactRef ref;
  ArtifactRoot root;       // as it was built
  uint64_t dag_nodes = 0;  // of all its levels
};

// Throws Error{kNotFound} if there is no file, Error{kCorrupt} or Error{kUnsupportedVersion}.
CacheEntry read_cache_entry(FileSystem& files, const std::string& path);

}  // namespace voxdag
