// Writes the colors of a part of a global file, or another attribute of its cells, behind the
// levels of the part's own file.
//
// The color grid of the part is the part of the file's, or that of the selected level if this is
// coarser; a part that has fewer than 4 cells of it along an edge gets 4, with the colors of the
// cells that they lie in. A cell of the part has
//
//   1. the color that the file stores for it, where the region does not cut it, and on the finest
//      level of the color grid;
//   2. otherwise the mean of the finest cells that are left of it, in linear light.
//
// The stored bytes of a region of colors are copied where the part has all of it in a region of its
// own: where the region lies within the selection, and the levels of its tier are those of a tier
// of the part, which depends on the finest and the coarsest level alone. Other regions are decoded
// and encoded again, so that their colors are near those of the file. The bytes depend on nothing
// but the file and the selection.
//
// Of other attributes the finest cells have what they have in the file, and coarser ones what the
// rule makes of that: where the region does not cut them, what they have in the file.
//
// The file is mapped here; of what is read every checksum block is compared with its checksum
// first, and its pages are released when the process is larger than the budget.
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
  const voxdag_reader::File& file;  // with the attribute
  const Selection& selection;       // of which something is set
  const Cube& crop;  // what becomes the new grid: all of it, or a cube around the region
};

// The levels of the color grid of the part, 2 to those of its grid.
uint32_t part_color_levels(const ColoredPart& part, Attribute attribute);

// The levels of `out` must be complete. Throws Error{kCorrupt} for a damaged file,
// Error{kOutOfMemory}, Error{kCanceled}, and voxdag_reader::Error.
void write_part_attribute(const ColoredPart& part, Attribute attribute, FileSystem& files,
                          GlobalFileWriter& out, MemoryBudget& budget, unsigned threads,
                          Progress& progress, const CancelToken& cancel);

}  // namespace voxdag::query
