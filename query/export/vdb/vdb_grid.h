// Parts of the exports to .vdb and .nvdb that all kinds of grids share. Only vdb.cc includes this
// file.
#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>

#include "query/export/export_job.h"
#include "query/lookup/bricks.h"

namespace voxdag::query {

// Bytes of memory for a leaf of 8^3 voxels, for a lower node of 128^3 voxels, and for an upper node
// of 4096^3 voxels. The sizes include the pointers in the nodes.
struct VdbNodeBytes {
  uint64_t leaf, lower, upper;
};

// Bytes of a tile of 4096^3 voxels in the root's table.
constexpr uint64_t kRootTileBytes = 128;

struct VdbSize {
  uint64_t voxels = 0, bytes = 0;
  uint64_t leaf_voxels = 0;  // voxels in leaves, not in tiles (full cubes)
  uint64_t leaves = 0;       // counted for level sets only
};

inline openvdb::Coord vdb_coord(const Position& cell) {
  return openvdb::Coord(static_cast<openvdb::Int32>(cell[0]), static_cast<openvdb::Int32>(cell[1]),
                        static_cast<openvdb::Int32>(cell[2]));
}

template <class GridType>
typename GridType::Ptr empty_vdb_grid(const ExportJob& job, const char* name) {
  auto grid = GridType::create();
  grid->setName(name);
  // OpenVDB's integer index coordinates denote the centers of voxels, so index 0 is mapped to the
  // center of the first voxel.
  auto transform = openvdb::math::Transform::createLinearTransform(job.cell_edge());
  transform->postTranslate({job.world(0, 0.5), job.world(1, 0.5), job.world(2, 0.5)});
  grid->setTransform(transform);
  return grid;
}

}  // namespace voxdag::query
