// Walks of a cube through empty voxels. The cube has V + 1 voxels per edge, 1 <= V <= kMaxRadius,
// and a *position* is its lowest voxel. The cube at position p has the voxels p + [0, V]^3.
//
//   blocked    a position at which the cube has a set voxel
//   closed     a blocked position, or one that no walk from outside reaches
//   enclosed   a voxel that no cube at an open position has: all positions in x - [0, V]^3 are
//              closed
//
// Both functions below compute a voxel of a cube from the voxels of the cube and of its seven
// neighbors in one direction. Equal neighborhoods of nodes are computed once, so the cost depends
// on the number of unique neighborhoods.
#pragma once

#include <array>
#include <cstdint>

#include "core/dag/consing/sub_dag_tables.h"
#include "core/dag/space/node_levels.h"

namespace voxdag {

inline constexpr uint32_t kMaxRadius = 16;

// A node of a sub-DAG. `levels` is null if the node's cube is empty.
struct NodePlace {
  const NodeLevels* levels = nullptr;
  int depth = 0;
  uint32_t row = 0;
};

// A cube and its neighbors in one direction. The cube has index 0. Index n has the neighbor one
// cube away along each axis a for which bit (4 >> a) of n is set. Places with the same `levels`
// must have the same depth.
using CubeNeighbors = std::array<NodePlace, 8>;

// Returns log2 of the edge of the smallest cubes that can be filtered. It is at least V.
int smallest_filtered(uint32_t radius);

// Returns the octants of a node of neighbor `n` that the functions below read, if the node's edge
// exceeds 2^smallest_filtered(). `is_higher`: the neighbors have larger coordinates than the cube.
uint8_t octants_near(int n, bool is_higher);

// Adds the nodes of the blocked positions in a cube of 2^size_log2 voxels per edge. Its neighbors
// are those with larger coordinates. Throws OutOfBudget.
NodeRef add_blocked(PooledMemory& memory, const CubeNeighbors& shell, int size_log2,
                    uint32_t radius, SubDagTables& tables);

// Adds the nodes of the enclosed voxels in a cube. `closed` has the closed positions in the cube
// and in its neighbors with smaller coordinates. Throws OutOfBudget.
NodeRef add_enclosed(PooledMemory& memory, const CubeNeighbors& closed, int size_log2,
                     uint32_t radius, SubDagTables& tables);

}  // namespace voxdag
