// The index at the end of an artifact: lists of its roots, its levels and their frames.
// docs/format.md, "Artifact index", documents the byte layout.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/dag/sub_dag.h"
#include "core/format/artifact/artifact.h"

namespace voxdag {

// The version of the format of segments and artifacts.
inline constexpr uint32_t kSegmentVersion = 1;
inline constexpr uint64_t kSegmentMagic = 0x0a47455347414456;  // "VDAGSEG\n"
inline constexpr uint64_t kIndexMagic = 0x0a58444947414456;    // "VDAGIDX\n"
inline constexpr size_t kSegmentHeaderBytes = 32;

struct ArtifactIndex {
  DagShape shape;
  std::vector<ArtifactRoot> roots;
  std::vector<ArtifactLevel> levels;  // first the bricks (level L-2), then the coarser levels
};

// Maximum size of the index of an artifact: enough for 3 * 10^10 rows.
inline constexpr uint64_t kMaxIndexBytes = uint64_t{256} << 20;
// Throws Error{kCorrupt} if the index of the artifact at `ref` is larger than kMaxIndexBytes. Call
// this before allocating memory for the index, because `ref` can come from a damaged file.
void check_index_bytes(const ArtifactRef& ref, const std::string& where);

// Throws Error{kLimit} if the artifact has too many roots or frames. The message begins with
// `where`.
std::vector<std::byte> encode_index(const ArtifactIndex& index, const std::string& where);

// Decodes the index of the artifact at `ref`. Throws Error{kCorrupt} or Error{kUnsupportedVersion}
// if any field violates the rules of docs/format.md, so a decoded index needs no further check. The
// message begins with `where`.
ArtifactIndex decode_index(std::span<const std::byte> bytes, const ArtifactRef& ref,
                           const std::string& where);

std::vector<std::byte> encode_segment_header(uint32_t id);
// Throws Error{kCorrupt} or Error{kUnsupportedVersion} unless `bytes` are the header of segment
// `id`. The message begins with `where`.
void check_segment_header(std::span<const std::byte> bytes, uint32_t id, const std::string& where);

}  // namespace voxdag
