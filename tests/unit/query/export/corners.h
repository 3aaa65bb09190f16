// Writes files with few voxels. write_corners() sets the two voxels in opposite corners of the
// grid; every format can store this file. write_tiles() divides the grid into equal cubes and sets
// the voxel at the low corner of each.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "core/format/global/global_writer.h"

namespace voxdag::query {

// Writes the level `level` with `nodes` nodes and the words `words`.
inline void write_level(GlobalFileWriter& writer, uint32_t level, uint64_t nodes,
                        const std::vector<uint32_t>& words) {
  writer.begin_level(level);
  writer.checksum_words(words);
  writer.write_words(0, words);
  writer.end_level({nodes, words.size()});
}

inline void write_corners(const std::string& path, const Grid& grid) {
  const uint32_t levels = grid.levels;
  GlobalFileWriter writer(system_files(), path, grid, 64);
  write_level(writer, levels - 2, 2, {1, 0, 0, 1u << 31});
  for (uint32_t level = levels - 2; level-- > 1;) write_level(writer, level, 2, {1, 0, 0x80, 2});
  write_level(writer, 0, 1, {0x81, 0, 2});
  writer.finish({2, 2 * (uint64_t{levels} - 2) + 1});
}

inline void write_corners(const std::string& path, uint32_t levels) {
  write_corners(path, Grid::given({0, 0, 0}, 1, levels));
}

// Writes a grid of 2^levels voxels per edge that is divided into 8^tile_levels cubes with one voxel
// each. All cubes are the same node of the DAG.
inline void write_tiles(const std::string& path, uint32_t levels, uint32_t tile_levels) {
  GlobalFileWriter writer(system_files(), path, Grid::given({0, 0, 0}, 1, levels), 64);
  write_level(writer, levels - 2, 1, {1, 0});
  uint64_t svo_nodes = uint64_t{1} << 3 * tile_levels;  // the bricks
  for (uint32_t level = levels - 2; level-- > 0;) {
    if (level < tile_levels)
      write_level(writer, level, 1, {0xff, 0, 0, 0, 0, 0, 0, 0, 0});
    else
      write_level(writer, level, 1, {1, 0});
    svo_nodes += uint64_t{1} << 3 * std::min(level, tile_levels);
  }
  writer.finish({uint64_t{1} << 3 * tile_levels, svo_nodes});
}

}  // namespace voxdag::query
