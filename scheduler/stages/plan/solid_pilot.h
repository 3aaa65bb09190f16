// The parts of a pilot (pilots.h) that only solids need. A pilot is one subvolume, whose cube is
// the grid.
#pragma once

#include <cstdint>

#include "core/backend/backend.h"
#include "core/dag/consing/pooled_memory.h"
#include "core/dag/space/node_levels.h"
#include "scheduler/solid/seed.h"
#include "scheduler/solid/solid_rows.h"
#include "scheduler/state/build_scene.h"

namespace voxdag {

// Levels of the finest pilot of an enclosed solid.
inline constexpr uint32_t kEnclosedPilotLevels = 11;

// The views (core/geometry/solid_rule.h) from the low faces of a pilot's grid, and the counts of
// its sample rows.
class PilotRows {
 public:
  // Charges the views to the budget. Throws OutOfBudget.
  PilotRows(MemoryBudget& budget, uint32_t levels);
  // Computes the views from all triangles of the pilot. If `beyond` is not null, also reads this
  // scene's triangles beyond the grid. `grid` is the scene's grid, which can be finer than the
  // pilot's. Throws OutOfBudget.
  void read(SolidRule rule, TriangleStream& triangles, BuildScene* beyond, Grid grid,
            const StageContext& context);

  const SolidEntry& entry() const { return entry_; }
  const RowCounts& counts() const { return counts_; }

 private:
  MemoryBudget& budget_;
  const uint32_t levels_;
  MemoryCharge charge_;
  SolidEntry entry_;
  RowCounts counts_;
};

// Receives the shell of a pilot: the voxels that triangles touch.
class ShellLevels : public SubDagSink {
 public:
  explicit ShellLevels(PooledMemory& memory) : memory_(memory) {}
  void bricks(const BrickLevelView& level) override;
  void nodes(const NodeLevelView& level) override;
  // Returns the levels in the order of their depth. Call it once, after the last level.
  NodeLevels finish();

 private:
  PooledMemory& memory_;
  NodeLevels levels_;
};

// Fills the enclosed space of a grid, or only the space around the build's seed. `radius` is in
// voxels of the pilot, and 0 in a build with a seed. Throws OutOfBudget.
SubDagSummary fill_pilot(PooledMemory& memory, const NodeLevels& shell,
                         const std::optional<Seed>& seed, uint32_t radius, uint32_t levels,
                         SubDagSink& sink);

}  // namespace voxdag
