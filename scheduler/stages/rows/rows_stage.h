// The rows stage of a solid. From the bins of all subvolumes, it computes the views
// (core/geometry/solid_rule.h) from the low faces of the subvolumes, and the full cubes
// (SolidRows::full_cubes).
//
//   1. For each subvolume, it adds up the crossings of the subvolume's triangles with the
//      subvolume's own sample rows (RowSums).
//   2. For each column of subvolumes along each axis (row_column.h), it computes the totals of the
//      column's rows. Then it computes the views from the low face of each subvolume, and from the
//      corners of empty cubes.
//
// Durable output: SolidRows. Resume rule: rows that an earlier run saved are used. Otherwise all
// subvolumes must have bins, which is true until the first one is built.
#pragma once

#include <span>

#include "scheduler/solid/solid_rows.h"
#include "scheduler/spec/build_spec.h"
#include "scheduler/stages/rows/outside_rows.h"
#include "scheduler/triangles/triangle_store.h"

namespace voxdag {

// A subvolume of the plan, and the bin of its triangles.
struct PlannedCube {
  Cube cube;
  BinId bin = 0;
};

// Computes and saves the rows of the subvolumes of the plan. `outside`: crossings outside the grid,
// or null if no triangle leaves the grid. Uses a temporary file at `spill_path`.
void compute_rows(SolidRows& rows, std::span<const PlannedCube> cubes,
                  const TriangleStore& triangles, const OutsideRows* outside,
                  const std::string& spill_path, const StageContext& context);

}  // namespace voxdag
