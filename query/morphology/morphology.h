// Dilates or erodes the voxels of a global file by a cube of 2N + 1 voxels per edge, whose center
// is the voxel itself. The levels of the new file are canonical: they depend only on the voxels.
//
// A dilation sets all voxels of the grid that are within N voxels of a set voxel on each axis.
// Voxels that would be outside of the grid are dropped. An erosion keeps the voxels whose cube has
// only set voxels. By default, voxels outside of the grid count as not set, so an erosion removes
// all voxels within N voxels of a face of the grid.
//
//   steps.h            the steps of a dilation or an erosion
//   neighbor_levels.h  the levels of the file that a step writes
//
// All values that can be large are in lists that spill to a scratch folder, as in query/combine.
#pragma once

#include <cstdint>

#include "core/base/progress.h"
#include "core/format/global/voxdag_reader.h"
#include "core/io/file_system.h"
#include "query/combine/combine.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

struct Morphology {
  bool is_erosion = false;
  uint64_t voxels = 1;          // N, at least 1
  bool is_outside_set = false;  // voxels outside of the grid count as set; only for erosions
};

// Writes the dilated or eroded file to spec.output, in the same way as combine(). Uses neither the
// operation, the offset nor the fill color in `spec`. `a` may have any node order; the result has
// the order by hash.
//
// Each color cell in which `a` has a voxel keeps its attributes. Each other cell of a dilated file
// has the attributes of the nearest color cell in which `a` has a voxel, measured between centers;
// on ties, of the cell with the lowest Morton code. The report's `pairs` are the groups
// (neighbor_levels.h) of all steps. Throws the errors of combine().
CombineReport change_by_cube(const voxdag_reader::File& a, const Morphology& morphology,
                             const CombineSpec& spec, FileSystem& files, Progress& progress,
                             const CancelToken& cancel);

}  // namespace voxdag::query
