// Finds the voxels that a walking cube cannot cover (`--solid enclosed --radius V`, docs/solid.md).
// The cube has V + 1 voxels per edge, 1 <= V <= kMaxRadius. It walks through empty voxels, from
// outside the grid. Its *position* is its voxel with the lowest coordinates, so the cube at
// position p consists of the voxels p + [0, V]^3.
//
//   blocked    a position at which the cube contains a set voxel
//   closed     a blocked position, or a position that no walk reaches
//   open       any other position
//   enclosed   a voxel x that is in no cube at an open position: all positions in x - [0, V]^3 are
//              closed
//
// add_blocked() and add_enclosed() compute these sets for one cube of the grid. The result in a
// node depends only on the node and on its seven neighbors in one direction. Equal groups of eight
// nodes are processed once, so the cost depends on the number of distinct groups.
#pragma once

#include <array>
#include <cstdint>

#include "core/dag/consing/sub_dag_tables.h"
#include "core/dag/space/node_levels.h"

namespace voxdag {

inline constexpr uint32_t kMaxRadius = 16;

// A node of a sub-DAG, in row `row` of the level at depth `depth` of `levels`. `levels` is null if
// the node's cube is empty.
struct NodePlace {
  const NodeLevels* levels = nullptr;
  int depth = 0;
  uint32_t row = 0;
};

// A cube (index 0) and its seven neighbors, all toward larger or all toward smaller coordinates.
// Neighbor n is one cube away along each axis a for which n contains the bit 4 >> a. Elements with
// the same `levels` must have the same `depth`.
using CubeNeighbors = std::array<NodePlace, 8>;

// Returns log2 of the edge of the smallest cubes that add_blocked() and add_enclosed() can process.
// This edge is at least `radius`.
int smallest_filtered(uint32_t radius);

// Returns a mask of the octants that the functions below read from a node of neighbor `n`: the
// octants near the cube. From nodes with an edge of at most 2^smallest_filtered(), the functions
// read all octants. `is_higher` is true if the neighbors have larger coordinates than the cube.
uint8_t octants_near(int n, bool is_higher);

// Adds a sub-DAG whose voxels are the blocked positions in a cube of 2^size_log2 voxels per edge to
// `tables`, and returns its root. `shell` has the set voxels of the cube and of its neighbors with
// larger coordinates. Throws OutOfBudget.
NodeRef add_blocked(PooledMemory& memory, const CubeNeighbors& shell, int size_log2,
                    uint32_t radius, SubDagTables& tables);

// Adds a sub-DAG of the enclosed voxels in a cube to `tables`, and returns its root. The voxels of
// `closed` are the closed positions in the cube and in its neighbors with smaller coordinates.
// Throws OutOfBudget.
NodeRef add_enclosed(PooledMemory& memory, const CubeNeighbors& closed, int size_log2,
                     uint32_t radius, SubDagTables& tables);

}  // namespace voxdag
