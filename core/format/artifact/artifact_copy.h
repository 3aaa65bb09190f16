// Copies artifacts between builds. A cache entry is a file with one artifact of one subvolume. The
// artifact can be copied into a segment as the artifact of another cube of the same size, because
// its hashes and indices do not depend on the cube's position or level. docs/format.md, "Cache
// entry", documents the byte layout.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "core/format/artifact/segment_writer.h"

namespace voxdag {

// Appends the artifact at `ref` in `from` to `to`, as the artifact of `cube` on a grid of
// 2^grid_levels voxels per edge. Verifies the checksums of the frames. Throws Error{kCorrupt} if
// the artifact is damaged, contains several subvolumes, or belongs to a cube of another size.
ArtifactRef copy_artifact(const ReadableFile& from, const ArtifactRef& ref, const Cube& cube,
                          uint32_t grid_levels, SegmentWriter& to);

// Two counts of a subvolume of a solid. SubDagSummary (core/dag/sub_dag.h) defines them. The
// artifact does not contain them, so the cache entry does.
struct SolidCounts {
  uint64_t interior = 0, disputed = 0;
};

// Writes the artifact at `ref` of `from` as the cache entry of `key` at `path`, atomically: writes
// the file `partial`, a name that only the caller uses, and renames it to `path`. `solid` is set
// for a subvolume of a solid. Does not sync the file. If a power failure damages an entry, its
// checksums fail, and a lookup of the entry is a cache miss. Returns the size of the file in bytes.
uint64_t write_cache_entry(FileSystem& files, const std::string& path, const std::string& partial,
                           const std::string& key, const ReadableFile& from, const ArtifactRef& ref,
                           const std::optional<SolidCounts>& solid = std::nullopt);

struct CacheEntry {
  std::unique_ptr<ReadableFile> file;
  ArtifactRef ref;
  ArtifactRoot root;       // the artifact's root, with the cube of the original build
  uint64_t dag_nodes = 0;  // nodes of all levels
  SolidCounts solid;       // all 0 if the subvolume is not of a solid
};

// Opens the cache entry of `key` and reads its artifact's index. Throws Error{kNotFound} if the
// file does not exist. Throws Error{kCorrupt} or Error{kUnsupportedVersion} if the file is invalid,
// or if it is the entry of another key. `is_solid`: the entry must be of a subvolume of a solid.
CacheEntry read_cache_entry(FileSystem& files, const std::string& path, const std::string& key,
                            bool is_solid = false);

}  // namespace voxdag
