// A checkpoint of the stages before the build of subvolumes (IngestStage): the scene, and the
// progress of the stages. The record is one row of the job store (job_store.h). The triangles
// themselves are in a file (durable_store.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/geometry/grid.h"
#include "scene/triangle_source.h"
#include "scheduler/state/checkpoint/content_digest.h"
#include "scheduler/triangles/durable_store.h"

namespace voxdag {

struct IngestCounts {
  uint64_t triangles = 0;        // triangles whose bounding boxes touch the grid
  uint64_t dropped_outside = 0;  // triangles whose bounding boxes miss the grid
  uint64_t dropped_invalid = 0;
  double expected_voxels = 0;  // sum over the triangles; shared voxels count more than once
};

enum class IngestStage : uint32_t {
  kScan,       // the bounds of the triangles up to `position` are known
  kIngest,     // the grid is known, and the triangles up to `position` are in the scene's bin
  kPartition,  // all triangles are in the scene's bin; the first `position` of them are also in
               // cube bins
  kReady,      // all triangles are in the cube bins; the scene's bin is released
};

// A plain value. Members that are not known yet have their defaults.
struct IngestState {
  IngestStage stage = IngestStage::kScan;
  uint32_t top_tree_depth = 0;
  uint64_t declared_triangles = 0;
  uint64_t position = 0;
  WorldBounds bounds;
  Grid grid;
  IngestCounts counts;
  ContentDigest digest;
  Extent top_tree;  // cells of the top tree in the durable store's file
  double top_tree_weight = 0;
  DurableStoreState triangles;  // empty again after IngestCheckpoint::finish()
};

struct IngestRecord {
  std::string request;            // the geometry options and scenes of the build
  std::vector<SourceFile> files;  // files of the scene
  IngestState state;
};

std::vector<std::byte> encode(const IngestRecord& record);
// Decodes a record. Throws Error{kCorrupt} for bytes that encode() did not write,
// Error{kUnsupportedVersion} for bytes of another version.
IngestRecord decode_ingest_record(std::span<const std::byte> bytes);

}  // namespace voxdag
