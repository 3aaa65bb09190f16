// Ingest: the scene's triangles are streamed, snapped to the grid, counted into the top tree and
// kept in one bin; then handed down to the subvolumes that the plan made.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/base/progress.h"
#include "core/geometry/grid.h"
#include "core/scene/triangle_source.h"
#include "scheduler/build_spec.h"
#include "scheduler/executor.h"
#include "scheduler/top_tree.h"
#include "scheduler/triangle_bins.h"

namespace voxdag {

// The cube that the geometry options ask for. Reads the whole scene once, unless bounds are given.
Grid choose_grid(const GeometryOptions& options, TriangleSource& scene, const Seams& seams);

struct IngestCounts {
  uint64_t triangles = 0;        // that may touch the grid
  uint64_t dropped_outside = 0;  // their boxes miss it
  double expected_voxels = 0;    // each triangle's own, shared voxels counted twice
  std::string sha256;            // of the grid and the snapped triangles: names the content
};

// Streams the scene into `bin` and counts it into `top`. Throws Error{kLimit} for a triangle that
// reaches into the grid from beyond the coordinate limit.
IngestCounts ingest(TriangleSource& scene, const Grid& grid, TriangleBins& bins, BinId bin,
                    TopTree& top, const Seams& seams);

// Hands the triangles of `bin` down to the planned subvolumes, which are then ready to build.
std::vector<QueuedSubvolume> hand_down(std::span<const StoredSubvolume> planned,
                                       uint32_t grid_levels, TriangleBins& bins, BinId bin,
                                       size_t buffer_bytes, const CancelToken& cancel);

}  // namespace voxdag
