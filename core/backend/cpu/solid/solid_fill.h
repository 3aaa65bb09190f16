// Decides which empty voxels of a subvolume are inside a solid (core/geometry/solid_rule.h), and
// fills them, while the subvolume is built. Holds the running views of the subvolume's sample rows
// (running_rows.h), and the views and units of the current tile. Used for one build, by one thread.
// Throws OutOfBudget.
#pragma once

#include <cstdint>
#include <optional>

#include "core/backend/backend.h"
#include "core/backend/cpu/memo/full_nodes.h"
#include "core/backend/cpu/raster/triangle_set.h"
#include "core/backend/cpu/solid/plane_views.h"
#include "core/backend/cpu/solid/running_rows.h"
#include "core/backend/cpu/solid/tile_filler.h"
#include "core/backend/cpu/solid/tile_views.h"
#include "core/dag/consing/sub_dag_tables.h"

namespace voxdag::cpu {

class SolidFill {
 public:
  // `task.solid` must not be null.
  SolidFill(const SubvolumeTask& task, const Kernels& kernels, PooledMemory& memory,
            SubDagTables& tables, FullNodes& full);

  // For a tile of 64^3 voxels with a single triangle, which covers the tile (plane_views.h):
  // returns the inner sides (plane.h) of the triangle's plane. Returns nullopt if the tile needs
  // begin_tile(), add(), finish_views() and fill(). If the tile's node can be made with these
  // sides, call pass_plane() with the number of filled voxels. `f` and `is_turned` are as for
  // PlaneViews::read().
  std::optional<PlaneViews::Sides> read_plane(const Plane& plane, int64_t f, bool is_turned,
                                              const LatticeCube& tile);
  void pass_plane(const PlaneViews::Sides& sides, uint64_t filled);

  // For each tile without a call of pass_plane(), in octree order, call begin_tile(), then add()
  // for each triangle, and then finish_views(). After that, the functions read_part_plane(), fill()
  // and empty_cube() may be called for cubes within the tile.
  void begin_tile(const LatticeCube& tile);
  void add(const FixedTriangle& triangle) { views_.add(triangle); }
  void finish_views();
  // For the tile or a cube within it, with a single triangle, which covers the cube: returns the
  // inner sides of the triangle's plane, or nullopt if the cube needs fill(). `f`: the plane's
  // offset from the cube. If the cube's node can be made with these sides, call pass_part() with
  // the number of filled voxels.
  std::optional<PlaneViews::Sides> read_part_plane(const Plane& plane, int64_t f,
                                                   const LatticeCube& cube) const;
  void pass_part(const PlaneViews::Sides& sides, uint64_t filled);
  // Fills the units (solid_rule.h) of the tile, or of a cube within it, that are inside the solid.
  // `bricks` has the voxels of the cube. Leaves the blocks of full_blocks() empty; TileReducer
  // treats them as full. Returns false, and fills nothing, if the cube has no voxel of the shell.
  bool fill(TileBricks& bricks, int size_log2, const LatticeCube& cube,
            const TileFiller::ForEachTriangle& for_each_triangle);
  // Returns a bit set of the full voxel blocks after fill(), for TileReducer::reduce_bricks().
  const uint64_t* full_blocks() const { return filler_.full_blocks(); }

  // Returns the views from the corners of a cube that has no voxels of the shell. In octree order,
  // the tiles before the cube and in the cube must be finished, and later tiles must not have
  // begun. A cube smaller than a tile must be in the current tile.
  UnitViews empty_cube(const LatticeCube& cube);
  // Returns the node of an empty cube that is a unit with the given views: the node of a full cube
  // if the unit is inside the solid, otherwise no node.
  NodeRef decide(const UnitViews& unit, int size_log2);

  const FilledVoxels& filled() const { return filled_; }

 private:
  // Sets `tile` to the position of a cube in the subvolume, in tiles.
  void position_of(const LatticeCube& cube, int (&tile)[3]) const;
  // Sets `block` to the position of a cube in the current tile, in blocks.
  void position_in_tile(const LatticeCube& cube, int (&block)[3]) const;

  const SolidRule rule_;
  SubDagTables& tables_;
  FullNodes& full_;
  LatticeCube box_;     // the subvolume
  int64_t tile_edge_;   // in lattice units
  LatticeCube tile_{};  // the current tile
  RunningRows running_;
  PlaneViews plane_views_;
  TileViews views_;
  TileFiller filler_;
  FilledVoxels filled_;
  SampleRows rows_;
};

}  // namespace voxdag::cpu
