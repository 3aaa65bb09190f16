// Casts the rays of a QuerySet with Embree, at the triangles of the scene from which the file was
// built. Embree finds the exact place of a hit on a triangle, and voxdag a voxel. So the numbers of
// rays with a hit can differ slightly.
#pragma once

#include <optional>
#include <string>

#include "bench/query/query_set.h"

namespace voxdag::query {

struct EmbreeTimings {
  double build_seconds = 0;  // CPU time of building the tree, without reading the scene
  uint64_t triangles = 0;
  // Memory that Embree has after the build: the tree, and the vertices and indices of the
  // triangles.
  uint64_t bytes = 0;
  // By rays per call: 1 or 8.
  Timing primary, primary_of_8, shadow, shadow_of_8;
};

// Measures the primary rays of `queries` and the rays `shadows` (in voxels of the file, like the
// rays of the grid of voxels). Reads the triangles of the scene in the file `scene`, and converts
// them to voxels of the file. Returns nullopt without Embree.
std::optional<EmbreeTimings> measure_embree(const DagFile& dag, const std::string& scene,
                                            const RaySet& primary, const RaySet& shadows);

}  // namespace voxdag::query
