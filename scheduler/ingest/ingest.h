// The two passes over a scene: the scan finds its bounds; ingest snaps its triangles to the grid,
// counts them into the top tree and stores them in the scene's bin. Both continue from the state
// that they are given, which may be that of an earlier run.
#pragma once

#include <functional>

#include "scheduler/build_spec.h"
#include "scheduler/ingest/ingest_record.h"
#include "scheduler/plan/top_tree.h"
#include "scheduler/triangles/triangle_store.h"

namespace voxdag {

// Called after each batch, when the state covers all triangles up to its position.
using AfterBatch = std::function<void()>;

// Adds the scene's triangles to the bounds of `state`.
void scan(TriangleSource& scene, IngestState& state, const BuildContext& context,
          const AfterBatch& after_batch);

// The grid that the geometry options describe, for a scene with these bounds.
Grid choose_grid(const GeometryOptions& options, const WorldBounds& bounds);

// Streams the scene into the only bin of `writer` and counts it into `top`. With `threads` > 1 the
// scene is read and snapped on this thread; a second one does the rest and calls `after_batch`.
// Throws Error{kLimit} for a triangle that reaches into the grid from beyond the coordinate limit.
void ingest(TriangleSource& scene, unsigned threads, IngestState& state, BinWriter& writer,
            TopTree& top, const BuildContext& context, const AfterBatch& after_batch);

}  // namespace voxdag
