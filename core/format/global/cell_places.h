// Functions to descend from cell to cell in a global file's DAG, down to voxels. The place of a
// cell is the word offset of its node or brick. Below the bricks it is the mask of the cell's
// children.
#pragma once

#include <cstdint>

#include "core/dag/brick.h"
#include "core/format/global/voxdag_reader.h"

namespace voxdag {

// Returns a bit for each child of a cell of level `level`.
inline uint32_t child_mask_at(const voxdag_reader::File& file, uint32_t level, uint64_t place) {
  if (level < file.brick_level()) return file.node(level, place).child_mask;
  return level == file.brick_level() ? octants(file.brick(place)) : static_cast<uint32_t>(place);
}

// Returns the place of a child, which must exist.
inline uint64_t child_place_at(const voxdag_reader::File& file, uint32_t level, uint64_t place,
                               int index) {
  if (level < file.brick_level()) return voxdag_reader::File::child(file.node(level, place), index);
  return level == file.brick_level() ? file.brick(place) >> 8 * index & 255 : 0;
}

}  // namespace voxdag
