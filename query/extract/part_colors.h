// Writes the colors of a part of a global file, or another attribute of its cells, behind the
// levels of the new file.
//
// The color grid of the part has the cell size of the file's color grid, or of the selected grid if
// that is coarser. If this would give fewer than 4 cells per edge, the color grid of the part has
// smaller cells, 4 per edge. They have the colors of the file's cells that contain them. A cell of
// the part has
//
//   1. the color stored in the file, on the finest level of the color grid and if the selection's
//      region does not cut the cell;
//   2. otherwise the mean of its finest cells that are inside that region, in linear light.
//
// Colors are stored in color regions of up to 64^3 cells; all color regions with the same levels
// are a tier (docs/format.md). A color region of the file is copied byte for byte if it is
// completely inside the selection, and if the part has a tier with the same finest level and the
// same level of color regions. Other color regions are decoded and encoded again, so their colors
// are close to the file's colors. The written bytes depend only on the file and the selection.
//
// For the other attributes, the finest cells have the file's values. The values of coarser cells
// are computed by the attribute's rule, so cells that the selection's region does not cut have the
// same values as in the file.
//
// This code reads the file through a mapping. Every checksum block is verified before it is read,
// and pages are released when the process exceeds the budget.
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
