// Compares a random sample of a solid's voxels with the scene. A voxel's winding number is the sum
// of the signs of the crossings (core/geometry/crossing.h) before the voxel's center, on one of the
// three rows (lines along an axis) through the center. The number is computed for each voxel
// separately. Only the test for a crossing is shared with the builder of solids.
//
// On a closed surface, the winding number is the same along all rows, and decides every voxel that
// no triangle touches. If the signs on a row do not add up to 0, the surface is not closed. A build
// then decides voxels by majorities of rows, so only voxels that triangles touch are compared.
//
// The voxels of an enclosed solid are compared with their neighbors in the file instead. Walks
// (docs/solid.md, "Enclosed") move an empty cube of radius + 1 voxels per edge, one voxel per step.
// Voxels outside the grid are empty.
//
// - A voxel that is not set must be in an empty cube, because the walks have reached it.
// - A set voxel can be next to an empty cube, which would contain the voxel after one step. Then
//   something must stop this step: a triangle must touch one of the set voxels that the cube would
//   move over. Without a radius, this is the voxel itself.
#pragma once

#include <cstdint>

#include "core/base/progress.h"
#include "core/format/global/voxdag_reader.h"
#include "core/geometry/grid.h"
#include "core/geometry/solid_rule.h"
#include "scene/triangle_source.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

inline constexpr size_t kInteriorVoxels = 256;

struct InteriorReport {
  bool is_closed = true;  // all sampled rows enter the solid as often as they leave it
  uint64_t voxels = 0;    // compared voxels
  uint64_t inside = 0;    // compared voxels that are inside
};

// Compares kInteriorVoxels random voxels of the grid. Throws Error{kCorrupt} with the first voxel
// that differs.
InteriorReport compare_interior(const voxdag_reader::File& file, TriangleSource& scene,
                                const Grid& grid, SolidRule rule, uint64_t seed, Progress& progress,
                                const CancelToken& cancel);

// Like compare_interior(), for an enclosed solid. The report's is_closed is always true.
InteriorReport compare_enclosed(const voxdag_reader::File& file, TriangleSource& scene,
                                const Grid& grid, uint32_t radius, uint64_t seed,
                                Progress& progress, const CancelToken& cancel);

}  // namespace voxdag::query
