// The two passes over a scene. The scan finds its bounds. Ingest snaps its triangles to the grid,
// counts them in the top tree and stores them in the scene's bin.
//
// Resume rule: scan and ingest continue from the given state, which an earlier run can have saved.
//
// Several threads read the scene in pieces of 16384 declared triangles. The results are processed
// in the order of the pieces, so the state and the plan do not depend on the number of threads.
#pragma once

#include <functional>

#include "core/color/cutouts/cutouts.h"
#include "scheduler/spec/build_spec.h"
#include "scheduler/stages/ingest/top_tree.h"
#include "scheduler/state/checkpoint/ingest_record.h"
#include "scheduler/triangles/triangle_store.h"

namespace voxdag {

// Called after each piece. The IngestState then covers all triangles up to its `position`.
using AfterPiece = std::function<void()>;

// Adds the scene's triangles to the bounds of `state`.
void scan(TriangleSource& scene, IngestState& state, const StageContext& context,
          const AfterPiece& after_piece);

// Returns the grid for these geometry options and a scene with these bounds.
Grid choose_grid(const GeometryOptions& options, const WorldBounds& bounds);

// Stores the scene's snapped triangles in the scene's bin of `store` and counts them in `top`.
// Throws Error{kLimit} for a triangle that reaches into the grid and has a vertex beyond
// kCoordinateLimit.
//
// With `cutouts`, a triangle that is cut out in part is replaced by patches in the voxels in which
// it is visible (core/color/patches). A triangle that is cut out completely is not stored.
void ingest(TriangleSource& scene, IngestState& state, TriangleStore& store, TopTree& top,
            const StageContext& context, const AfterPiece& after_piece,
            const Cutouts* cutouts = nullptr);

// Returns the digest of a scene to which no triangles have been added yet.
ContentDigest initial_digest(const Grid& grid, const Cutouts* cutouts);

}  // namespace voxdag
