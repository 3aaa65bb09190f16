// The state of a solid's interior while a subvolume is built: running rows, the views and the units
// of the current tile, and the nodes of full cubes. Used for one build, by one thread. Throws
// OutOfBudget.
#pragma once

#include <cstdint>

#include "core/backend/backend.h"
#include "core/backend/cpu/raster/triangle_set.h"
#include "core/backend/cpu/solid/running_rows.h"
#include "core/backend/cpu/solid/tile_filler.h"
#include "core/backend/cpu/solid/tile_views.h"
#include "core/dag/consing/sub_dag_tables.h"

namespace voxdag::cpu {

class SolidFill {
 public:
  // `task.solid` must not be null.
  SolidFill(const SubvolumeTask& task, PooledMemory& memory, SubDagTables& tables);

  // For each tile in octree order: begin_tile(), then add() for each triangle, then fill_tile().
  void begin_tile(const LatticeCube& tile);
  void add(const FixedTriangle& triangle) { views_.add(triangle); }
  // Fills the units of the tile that are inside. Returns false, and fills nothing, if the tile has
  // no voxel of the shell.
  bool fill_tile(TileBricks& bricks, int size_log2,
                 const TileFiller::ForEachTriangle& for_each_triangle);

  // Returns the views of a cube without voxels of the shell. The cube is at least as large as a
  // tile. The tiles before the cube and in the cube must be finished, and no later tile may have
  // begun.
  UnitViews empty_cube(const LatticeCube& cube);
  // Returns the node of an empty cube that is a unit: full if it is inside, otherwise none.
  NodeRef decide(const UnitViews& unit, int size_log2);

  const FilledVoxels& filled() const { return filled_; }

 private:
  NodeRef full_node(int size_log2);
  void position_of(const LatticeCube& cube, int (&tile)[3]) const;

  const SolidRule rule_;
  SubDagTables& tables_;
  LatticeCube box_;     // the subvolume
  int64_t tile_edge_;   // in lattice units
  LatticeCube tile_{};  // the current tile
  RunningRows running_;
  TileViews views_;
  TileFiller filler_;
  FilledVoxels filled_;
  SampleRows rows_;
  NodeRef full_[kMaxGridLevels + 1];
};

}  // namespace voxdag::cpu
