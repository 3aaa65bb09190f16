// The report of a solid's interior, and the warnings about it.
#pragma once

#include <optional>
#include <span>

#include "core/base/warning.h"
#include "core/geometry/grid.h"
#include "scheduler/solid/seed.h"
#include "scheduler/solid/solid_rows.h"
#include "scheduler/spec/build_report.h"

namespace voxdag {

// Returns the report without the volume. `interior` and `disputed` count the voxels of subvolumes;
// the function adds the voxels of rows.full_cubes.
SolidReport solid_report(const SolidRows& rows, uint64_t interior, uint64_t disputed);

// Returns the report of an enclosed solid, without the volume. `shell`: number of voxels that
// triangles touch.
SolidReport enclosed_report(uint64_t voxels, uint64_t shell);

// Returns the volume of these voxels, in cubic units of the scene.
double solid_volume(const Grid& grid, uint64_t voxels);

// Returns the warning for a seed whose empty space reaches the border of the grid.
Warning seed_warning(const Seed& seed, const std::string& scene);

// Returns a warning if the surface is open, if its faces are oriented inconsistently, if the faces
// cancel each other, or if an enclosed solid has no interior.
std::optional<Warning> solid_warning(const SolidReport& report, const std::string& scene);

}  // namespace voxdag
