// Functions to descend from cell to cell in a global file's DAG, down to voxels. The *place* of a
// cell is the number with which these functions find the cell's children. For a node or brick it is
// the word offset in the level. For a cell below a brick it is the mask of the cell's children,
// which is 0 for voxels.
#pragma once

#include <cstdint>

#include "core/dag/brick.h"
#include "core/format/global/voxdag_reader.h"

namespace voxdag {

// Returns the mask of the existing children of the cell at `place` on level `level`: bit i is set
// if child i exists.
inline uint32_t child_mask_at(const voxdag_reader::File& file, uint32_t level, uint64_t place) {
  if (level < file.brick_level()) return file.node(level, place).child_mask;
  return level == file.brick_level() ? octants(file.brick(place)) : static_cast<uint32_t>(place);
}

// Returns the place of child `index`, which must exist, on level `level` + 1.
inline uint64_t child_place_at(const voxdag_reader::File& file, uint32_t level, uint64_t place,
                               int index) {
  if (level < file.brick_level()) return voxdag_reader::File::child(file.node(level, place), index);
  return level == file.brick_level() ? file.brick(place) >> 8 * index & 255 : 0;
}

}  // namespace voxdag
