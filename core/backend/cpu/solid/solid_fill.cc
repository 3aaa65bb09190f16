#include "core/backend/cpu/solid/solid_fill.h"

#include <algorithm>

namespace voxdag::cpu {
namespace {

int tile_log2_of(const SubvolumeTask& task) {
  return std::min(static_cast<int>(task.grid_levels - task.cube.level), kTileLog2);
}
int tiles_of(const SubvolumeTask& task) {
  return 1 << (static_cast<int>(task.grid_levels - task.cube.level) - tile_log2_of(task));
}
int blocks_of(const SubvolumeTask& task) {
  return 1 << (tile_log2_of(task) - solid_block_log2(task.grid_levels));
}

}  // namespace

SolidFill::SolidFill(const SubvolumeTask& task, const Kernels& kernels, PooledMemory& memory,
                     SubDagTables& tables, FullNodes& full)
    : rule_(task.solid->rule),
      tables_(tables),
      full_(full),
      box_(lattice_cube(task.cube, task.grid_levels)),
      tile_edge_(kUnitsPerVoxel << tile_log2_of(task)),
      running_(memory, *task.solid, tiles_of(task), blocks_of(task)),
      plane_views_(rule_, running_),
      filler_(kernels, rule_, task.grid_levels, memory),
      rows_{{0, 0, 0}, sample_pitch_log2(task.grid_levels), blocks_of(task)} {}

std::optional<PlaneViews::Sides> SolidFill::read_plane(const Plane& plane, int64_t f,
                                                       bool is_turned, const LatticeCube& tile) {
  int position[3];
  position_of(tile, position);
  return plane_views_.read(plane, f, is_turned, position);
}

void SolidFill::pass_plane(const PlaneViews::Sides& sides, uint64_t filled) {
  plane_views_.advance();
  pass_part(sides, filled);
}

void SolidFill::pass_part(const PlaneViews::Sides& sides, uint64_t filled) {
  filled_.filled += filled;
  if (sides.is_disputed) filled_.disputed += filled;
}

void SolidFill::begin_tile(const LatticeCube& tile) {
  tile_ = tile;
  std::copy(tile.low, tile.low + 3, rows_.low);
  views_.begin(rows_);
}

void SolidFill::finish_views() {
  int tile[3];
  position_of(tile_, tile);
  views_.finish(rule_, running_, tile);
}

std::optional<PlaneViews::Sides> SolidFill::read_part_plane(const Plane& plane, int64_t f,
                                                            const LatticeCube& cube) const {
  int low[3];
  position_in_tile(cube, low);
  return PlaneViews::read_part(views_, plane, f, low,
                               static_cast<int>(cube.edge >> rows_.pitch_log2));
}

bool SolidFill::fill(TileBricks& bricks, int size_log2, const LatticeCube& cube,
                     const TileFiller::ForEachTriangle& for_each_triangle) {
  int low[3];
  position_in_tile(cube, low);
  return filler_.fill(bricks, size_log2, cube.low, views_, low, for_each_triangle, filled_);
}

UnitViews SolidFill::empty_cube(const LatticeCube& cube) {
  int low[3];
  if (cube.edge < tile_edge_) {
    position_in_tile(cube, low);
    return views_.corners_of(low, static_cast<int>(cube.edge >> rows_.pitch_log2));
  }
  position_of(cube, low);
  return running_.corners_of(low, static_cast<int>(cube.edge / tile_edge_));
}

NodeRef SolidFill::decide(const UnitViews& unit, int size_log2) {
  if (!unit.is_inside()) return {};
  filled_.add(unit, uint64_t{1} << 3 * size_log2);
  tables_.counts() += full_counts(size_log2);
  return full_.node(size_log2);
}

void SolidFill::position_of(const LatticeCube& cube, int (&tile)[3]) const {
  for (int a = 0; a < 3; ++a) tile[a] = static_cast<int>((cube.low[a] - box_.low[a]) / tile_edge_);
}

void SolidFill::position_in_tile(const LatticeCube& cube, int (&block)[3]) const {
  for (int a = 0; a < 3; ++a)
    block[a] = static_cast<int>((cube.low[a] - tile_.low[a]) >> rows_.pitch_log2);
}

}  // namespace voxdag::cpu
