// Pilot builds: the whole scene as one subvolume on a coarser grid, counted and thrown away.
#pragma once

#include <cstdint>
#include <optional>

#include "core/backend/backend.h"
#include "scheduler/triangles/triangle_store.h"

namespace voxdag {

struct PilotCounts {
  uint32_t levels = 0;  // of the pilot's grid
  double voxels = 0;
  double svo_nodes = 0;
  double dag_nodes = 0;
  double file_bytes = 0;  // what its global file would take
  double cpu_s = 0;
};

// Builds the scene's triangles, snapped to 2^grid_levels, on a grid of 2^pilot_levels. Nothing if
// that does not fit the budget.
std::optional<PilotCounts> build_pilot(const TriangleStore& triangles, uint32_t grid_levels,
                                       uint32_t pilot_levels, Backend& backend,
                                       MemoryBudget& budget, const CancelToken& cancel);

}  // namespace voxdag
