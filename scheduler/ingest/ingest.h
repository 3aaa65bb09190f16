// The passes over a scene: the scan finds its bounds; ingest snaps its triangles to the grid,
// counts them into the top tree and keeps them in one bin. Both go on from any state that an
// earlier pass left.
#pragma once

#include <functional>

#include "scheduler/build_spec.h"
#include "scheduler/ingest/ingest_record.h"
#include "scheduler/plan/top_tree.h"
#include "scheduler/triangles/triangle_bins.h"

namespace voxdag {

// Called after each batch, when `state` speaks of all triangles up to its position.
using AfterBatch = std::function<void()>;

// Adds the scene's triangles to the bounds of `state`.
void scan(TriangleSource& scene, IngestState& state, const BuildContext& context,
          const AfterBatch& after_batch);

// The cube that the geometry options ask for, of a scene with these bounds.
Grid choose_grid(const GeometryOptions& options, const WorldBounds& bounds);

// Streams the scene into the only bin of `writer` and counts it into `top`, on two threads if there
// may be two: one reads, the other, which calls `after_batch`, does all the rest. Throws
// Error{kLimit} for a triangle that reaches into the grid from beyond the coordinate limit.
void ingest(TriangleSource& scene, unsigned threads, IngestState& state, BinWriter& writer,
            TopTree& top, const BuildContext& context, const AfterBatch& after_batch);

}  // namespace voxdag
