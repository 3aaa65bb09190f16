// Chooses the color grid of a file that combines the voxels of two files (query/combine). All
// attributes of a file have the same color grid, because a build also stores them on one grid.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/progress.h"
#include "core/format/global/voxdag_reader.h"
#include "query/attributes/combined_section.h"

namespace voxdag::query {

// Throws Error{kInvalidInput} if the new file has no attributes (`has_attributes` is false),
// although the user has set an option for its attributes.
void check_attribute_options(bool has_attributes, bool has_fill_color, uint64_t color_resolution);
// Returns a warning: the option color_resolution was set, but the files have no attributes.
std::string unused_color_resolution();

// Throws Error{kInvalidInput} unless `cells`, the maximum number of color cells per edge of the
// grid of `a`, is 0 (no limit) or a power of two from 4 to the resolution.
void refuse_color_resolution(const voxdag_reader::File& a, uint64_t cells);

// Returns the level of the result's finest cells. These are as small as the finest cells of any
// file and attribute from which the result takes values, but not smaller than 1/limit of the grid's
// edge (0: no limit). The result has the grid of `a`; messages name this file `name_of_a`. Warns if
// the cells of a file are divided. Throws Error{kInvalidInput} if a cell would be larger than one
// of the files.
uint32_t color_levels_of(const voxdag_reader::File& a, const std::string& name_of_a,
                         const voxdag_reader::File& b,
                         const std::vector<CombinedAttribute>& attributes, uint64_t limit,
                         Progress& progress);

}  // namespace voxdag::query
