// Writes the colors, or another attribute, of a part of a global file. The attribute is written
// after the levels of the new file.
//
// The color grid of the part has the cells of the file's color grid, or of the selected grid if the
// selected grid is coarser. If fewer than 4 such cells fit along an edge of the part, the color
// grid of the part has 4 smaller cells per edge instead. Each smaller cell has the color of the
// file's cell that contains it. The color of a cell of the part is
//
//   1. the color stored in the file, if the cell is on the finest level of the color grid and the
//      selection's region does not cut the cell;
//   2. otherwise the mean, in linear light, of the cell's finest cells inside that region.
//
// Colors are stored in color regions of up to 64^3 cells; all color regions with the same levels
// are a tier (docs/format.md). A color region is copied byte for byte if it is completely inside
// the selection, and if the part has a tier with the same finest level and the same level of color
// regions. Other color regions are decoded and encoded again, so their colors are only close to the
// file's colors. The written bytes depend only on the file and the selection.
//
// For the other attributes, the finest cells have the file's values. The attribute's rule computes
// the values of coarser cells. So cells that the selection's region does not cut have the same
// values as in the file.
//
// This code reads the file through a mapping. It verifies every checksum block before the first
// use, and releases pages when the process exceeds the budget.
#pragma once

#include <cstdint>

#include "core/base/memory_budget.h"
#include "core/base/progress.h"
#include "core/color/attribute_set.h"
#include "core/format/global/global_writer.h"
#include "core/format/global/voxdag_reader.h"
#include "core/geometry/cube.h"
#include "core/io/file_system.h"
#include "query/dag/selection.h"
#include "voxdag/cancel_token.h"

namespace voxdag::query {

struct ColoredPart {
  const voxdag_reader::File& file;  // has the attribute
  const Selection& selection;       // has at least one set cell
  const Cube& crop;                 // the new grid: the complete grid or a cube around the region
};

// Returns the number of levels of the part's color grid: at least 2, at most the number of levels
// of the part's grid.
uint32_t part_color_levels(const ColoredPart& part, Attribute attribute);

// Writes the attribute to `out`, in which the levels must be complete. Throws Error{kCorrupt} for a
// damaged file, Error{kOutOfMemory}, Error{kCanceled}, and voxdag_reader::Error.
void write_part_attribute(const ColoredPart& part, Attribute attribute, FileSystem& files,
                          GlobalFileWriter& out, MemoryBudget& budget, unsigned threads,
                          Progress& progress, const CancelToken& cancel);

}  // namespace voxdag::query
