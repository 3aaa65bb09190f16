// The parts of an artifact. An artifact is a sub-DAG on disk between the build and the merge; one
// segment file contains many artifacts. docs/format.md, "Segments and artifacts", documents the
// byte layout.
//
//   segment:   [header] [artifact] [artifact] ...
//   artifact:  [frames of the bricks] [frames of level L-3] ... [frames of its top level] [index]
//
// A row is a node or a brick. A frame has kFrameRows consecutive rows of one level; the last frame
// of a level can have fewer rows. Frames store rows by columns (all hashes, all masks, all
// children). A column is compressed if that saves enough. The index lists the roots, levels and
// frames of the artifact, with the checksum of each frame's stored bytes. An ArtifactRef has the
// position and the checksum of the index, so a reader never scans a segment. The artifact of one
// subvolume has one root; a merge pass writes artifacts with many roots.
//
// Writers check rows before they write them, and readers check them again: rows are sorted by
// (hash, mask, children), masks are not 0, and children are rows of the level below. Readers also
// verify checksums and counts.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/geometry/cube.h"

namespace voxdag {

inline constexpr uint32_t kFrameRows = 4096;

// The position of an artifact in a segment, in bytes from the start of the file. `checksum` covers
// the index, which contains the checksums of all frames.
struct ArtifactRef {
  uint32_t segment = 0;       // id of the segment file
  uint64_t offset = 0;        // first byte of the artifact
  uint64_t bytes = 0;         // size of the frames and the index together
  uint64_t index_offset = 0;  // first byte of the index
  uint64_t checksum = 0;
  bool operator==(const ArtifactRef&) const = default;
};

// A range of bytes in a segment.
struct SegmentRange {
  uint32_t segment = 0;
  uint64_t offset = 0;
  uint64_t bytes = 0;
};

// The root node of one subvolume's DAG: row `index` of level cube.level in the artifact.
struct ArtifactRoot {
  Cube cube;
  uint32_t index = 0;
  uint64_t hash = 0;  // truncated to DagShape::hash_bits bits
  uint64_t voxels = 0;
  uint64_t svo_nodes = 0;
};

// Describes a frame: its position in its level and in the segment, its size and its checksum.
struct FrameInfo {
  uint64_t first_row = 0;
  uint64_t first_child = 0;  // number of children of all earlier rows of the level
  uint64_t first_hash = 0;   // truncated hash of the frame's first row
  uint64_t offset = 0;       // offset of its first byte in the segment
  uint32_t bytes = 0;        // stored size
  uint32_t rows = 0;
  uint32_t children = 0;
  uint64_t checksum = 0;
};

struct ArtifactLevel {
  uint32_t level = 0;
  uint64_t rows = 0;
  uint64_t children = 0;
  std::vector<FrameInfo> frames;
};

// A decoded frame, and buffers that are reused when the next frame is decoded.
struct Frame {
  uint32_t rows = 0;
  std::vector<uint64_t> brick_masks;  // brick level only
  std::vector<uint64_t> hashes;       // truncated hashes of all rows, also of bricks
  std::vector<uint8_t> masks;         // node levels only
  std::vector<uint32_t> children;     // node levels only, popcount(masks[i]) for row i
  std::vector<std::byte> stored;      // buffer: the bytes as stored
  std::vector<std::byte> planes;      // buffer: one decompressed column
};

}  // namespace voxdag
