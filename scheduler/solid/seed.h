// The seed of an enclosed solid: a point. Only the enclosed space around the seed is filled.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "core/backend/backend.h"
#include "core/dag/space/seed_place.h"
#include "core/geometry/cube.h"
#include "core/geometry/grid.h"
#include "scheduler/spec/build_spec.h"
#include "voxdag/cancel_token.h"

namespace voxdag {

struct Seed {
  CubeVoxel voxel{};    // the voxel of the grid that contains the point
  std::string text;     // the point as "X,Y,Z"
  uint32_t radius = 0;  // GeometryOptions::radius
};

// Returns the seed of a build, or nullopt if it has none. Throws Error{kInvalidInput} if the point
// is outside the grid.
std::optional<Seed> seed_of(const GeometryOptions& options, const Grid& grid);

// Returns the seed's position in a cube of the grid, or nullopt if the cube does not contain it.
std::optional<CubeVoxel> seed_in(const std::optional<Seed>& seed, const Cube& cube,
                                 uint32_t grid_levels);

// Returns the position at which the walking cube of a build with a radius V starts
// (stages/enclose/cube_walks.h). At this position, the voxel that has the index V / 2 (rounded
// down) along each axis of the walking cube is the seed's voxel. The position is in the grid of the
// positions. `radius` is V, and `grid_levels` are the levels of the grid of the voxels.
CubeVoxel start_position(const Seed& seed, uint32_t radius, uint32_t grid_levels);

// Returns true if a triangle touches the seed's voxel or, in a build with a radius, a voxel of the
// walking cube at its start position. A build then throws the error of refuse_seed_in_shell().
// `triangles` are all triangles of the scene, on the build's grid.
bool is_in_shell(const Seed& seed, uint32_t grid_levels, TriangleStream& triangles,
                 const CancelToken& cancel);

// Throws UnbuildableJob{kInvalidInput} with the message that a triangle touches the seed's voxel
// or, in a build with a radius, a voxel of the walking cube at its start position.
[[noreturn]] void refuse_seed_in_shell(const Seed& seed);

}  // namespace voxdag
