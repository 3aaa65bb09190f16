// What is durable of scan, ingest and hand-down: which scene they were of and how far they are. One
// row of the job store holds it; the triangles themselves lie in the kept file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/geometry/grid.h"
#include "core/scene/triangle_source.h"
#include "scheduler/ingest/content_digest.h"
#include "scheduler/triangles/triangle_file.h"

namespace voxdag {

struct IngestCounts {
  uint64_t triangles = 0;        // that may touch the grid
  uint64_t dropped_outside = 0;  // their boxes miss it
  uint64_t dropped_invalid = 0;
  double expected_voxels = 0;  // each triangle's own, shared voxels counted twice
};

enum class IngestStage : uint32_t {
  kScan,      // the bounds of the triangles up to `position` are known
  kIngest,    // the grid is known, and the triangles up to `position` are in the whole bin
  kHandDown,  // all are; those of the whole bin up to `position` are in the subvolumes' bins, too
  kReady,     // all are, and the whole bin is gone; so is the file once all subvolumes are built
};

// Plain data. What is not known yet is as it is here.
struct IngestState {
  IngestStage stage = IngestStage::kScan;
  uint32_t top_tree_depth = 0;
  uint64_t declared_triangles = 0;
  uint64_t position = 0;
  WorldBounds bounds;
  Grid grid;
  IngestCounts counts;
  ContentDigest digest;
  // Pieces of the kept file, and its end.
  Extent top_tree;  // its cells
  double top_tree_weight = 0;
  Extent cubes;   // of the subvolumes' bins, which follow the whole bin in this order
  Extent chunks;  // the last link of the chain
  uint64_t file_end = 0;
};

struct IngestRecord {
  std::string request;            // geometry options and scenes, as they were asked for
  std::vector<SourceFile> files;  // that the scene was read from
  IngestState state;
};

std::vector<std::byte> encode(const IngestRecord& record);
// Throws Error{kCorrupt} for what encode() never gave, Error{kUnsupportedVersion} for what it gives
// in another version.
IngestRecord decode_ingest_record(std::span<const std::byte> bytes);

}  // namespace voxdag
