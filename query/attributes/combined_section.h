// Writes the colors, or another attribute, of a file that combines the voxels of two files
// (query/combine).
//
// A section stores a value for each set cell of the attribute's grid, the *finest cells*, and of
// all coarser levels. All attributes of the result have the same finest cells (CombinedFiles). A
// finest cell of the result has
//
//   1. A's value, if A has the attribute and a voxel in the cell;
//   2. otherwise B's value, if B has the attribute and a voxel in the cell;
//   3. otherwise the value of A's nearest cell, or the fill color.
//
// A and B are the two files. If the finest cells of a file are larger than the cells of the result,
// a cell of the result gets the value of the larger cell that contains it. If they are smaller, it
// gets the value that the file stores for a cell of its size. If B is moved and its cells do not
// align with the result's cells, then by rule 2 a cell of the result gets the value of the cell of
// B that overlaps it most. Only cells of B that have voxels and the size of the result's cell are
// considered. On ties, the cell with the lowest x is used, then the cell with the lowest y, then
// the cell with the lowest z.
//
// The color of a coarser cell is the mean, in linear light, of the cell's finest cells. The other
// attributes have rules for coarser cells (docs/format.md).
//
// Colors are stored in color regions of up to 64^3 cells. A color region is copied byte for byte
// from A or B if all its finest cells have the colors of that file, and the file stores a region
// with the same cells at an aligned place. The other color regions are encoded from decoded colors.
// The bytes depend only on the contents of the inputs.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "core/base/memory_budget.h"
#include "core/base/progress.h"
#include "core/color/attributes.h"
#include "core/format/global/global_writer.h"
#include "core/format/global/voxdag_reader.h"
#include "core/io/file_system.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

// An attribute of the result, and the files from which it takes values: at least one file, which
// must have the attribute.
struct CombinedAttribute {
  Attribute attribute;
  bool from_a = false, from_b = false;
};

struct CombinedFiles {
  const voxdag_reader::File& result;  // has the voxels of the result; not empty
  const voxdag_reader::File& a;
  const voxdag_reader::File& b;        // as it was given, not moved
  const voxdag_reader::File& moved_b;  // B's voxels in the result's grid
  // The voxel of the result's grid at which B's voxel (0, 0, 0) is placed.
  std::array<int64_t, 3> offset = {};
  std::optional<voxdag_reader::Rgb> fill = {};
  // Level of the finest cells of the result. Files must not have the attribute if their grid is
  // smaller than these cells.
  uint32_t levels = 0;
  // If not 0, a cell in which no file has a value has the value of the nearest cell of A with the
  // same edge in which A has a voxel. The distance is measured between centers; on ties, the cell
  // with the lowest Morton code is used. There must be such a cell at a distance of at most
  // `nearest_reach` cells on each axis. A must have all attributes.
  uint32_t nearest_reach = 0;
};

// Returns the level of the result whose cubes have the edge of the finest cells of an attribute of
// `file`, which must have the attribute. The result has `grid_levels` levels. The returned level is
// negative if these cells are larger than the result's grid.
int64_t finest_level_of(const voxdag_reader::File& file, Attribute attribute, uint32_t grid_levels);

// Writes the attribute to `out`, in which the levels must be complete. Throws Error{kCorrupt} for a
// damaged file, Error{kLimit} for too many materials, Error{kOutOfMemory}, Error{kCanceled} and
// voxdag_reader::Error.
void write_combined_attribute(const CombinedFiles& from, const CombinedAttribute& attribute,
                              FileSystem& files, GlobalFileWriter& out, MemoryBudget& budget,
                              unsigned threads, Progress& progress, const CancelToken& cancel);

}  // namespace voxdag::query
