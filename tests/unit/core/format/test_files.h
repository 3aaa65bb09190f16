// Helpers for the tests of file formats: a temporary folder, functions that read and write complete
// files as bytes, random voxels with structure, and global files made from the oracle's DAGs.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "core/format/global/global_writer.h"
#include "tests/oracle/dag.h"
#include "tests/oracle/scenes.h"
#include "tests/support/error_of.h"
#include "tests/support/temporary_folder.h"

namespace voxdag {

using ByteString = std::string;

inline ByteString read_bytes(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

inline void write_bytes(const std::string& path, const ByteString& bytes) {
  std::ofstream out(path, std::ios::binary | std::ios::trunc);
  out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

// Returns blobs, walls and scattered voxels. Their DAGs have shared nodes on every level.
inline oracle::Voxels random_voxels(uint64_t seed, int edge) {
  oracle::Random random(seed);
  oracle::Voxels voxels(edge);
  const int block = std::min(edge, 4 << random.between(0, 1));
  for (int i = 0; i < 6; ++i) {
    const int thick = static_cast<int>(random.between(1, 3));
    int low[3];
    for (int& l : low) l = static_cast<int>(random.between(0, edge / block - 1)) * block;
    for (int x = low[0]; x < std::min(edge, low[0] + block); ++x)
      for (int y = low[1]; y < std::min(edge, low[1] + thick); ++y)
        for (int z = low[2]; z < std::min(edge, low[2] + 2 * block); ++z) voxels.set(x, y, z);
  }
  for (int i = 0; i < edge; ++i)
    voxels.set(static_cast<int>(random.between(0, edge - 1)),
               static_cast<int>(random.between(0, edge - 1)),
               static_cast<int>(random.between(0, edge - 1)));
  return voxels;
}

// Returns `count` voxels at random places, some of them equal. Their DAGs have many nodes.
inline oracle::Voxels noise_voxels(uint64_t seed, int edge, int count) {
  oracle::Random random(seed);
  oracle::Voxels voxels(edge);
  const auto at_random = [&] { return static_cast<int>(random.between(0, edge - 1)); };
  for (int i = 0; i < count; ++i) voxels.set(at_random(), at_random(), at_random());
  return voxels;
}

// Returns the words of the oracle's levels in the layout of the global file, beginning with the
// bricks. Pointers to a level of more than `narrow_words` words have 64 bits, other pointers 32
// bits.
inline std::vector<std::vector<uint32_t>> level_words(
    const oracle::Dag& dag, uint64_t narrow_words = global_layout::kNarrowLevelWords) {
  std::vector<std::vector<uint32_t>> levels;
  if (dag.bricks.empty()) return levels;
  std::vector<uint32_t> offsets, words;
  for (const uint64_t mask : dag.bricks) {
    offsets.push_back(static_cast<uint32_t>(words.size()));
    words.push_back(static_cast<uint32_t>(mask));
    words.push_back(static_cast<uint32_t>(mask >> 32));
  }
  levels.push_back(words);
  for (const auto& nodes : dag.levels) {
    std::vector<uint32_t> own_offsets;
    words.clear();
    for (const oracle::Node& node : nodes) {
      own_offsets.push_back(static_cast<uint32_t>(words.size()));
      words.push_back(node.mask);
      for (const uint32_t child : node.children) {
        words.push_back(offsets[child]);
        if (levels.back().size() > narrow_words) words.push_back(0);
      }
    }
    offsets = own_offsets;
    levels.push_back(words);
  }
  return levels;
}

inline Grid grid_of(int edge) {
  Grid grid;
  grid.levels = levels_of_resolution(static_cast<uint64_t>(edge));
  grid.origin = {-1.5, 0.25, 3};
  grid.edge = 2.5;
  return grid;
}

inline GlobalFileSummary write_global(const std::string& path, const oracle::Dag& dag,
                                      const Grid& grid, uint32_t hash_bits = 64,
                                      uint64_t narrow_words = global_layout::kNarrowLevelWords) {
  GlobalFileWriter writer(system_files(), path, grid, hash_bits, narrow_words);
  uint32_t level = grid.levels - 2;
  const auto levels = level_words(dag, narrow_words);
  for (size_t i = 0; i < levels.size(); ++i, --level) {
    writer.begin_level(level);
    writer.checksum_words(levels[i]);
    writer.write_words(0, levels[i]);
    writer.end_level({i == 0 ? dag.bricks.size() : dag.levels[i - 1].size(), levels[i].size()});
  }
  return writer.finish({dag.voxels, dag.svo_nodes});
}

inline GlobalFileSummary write_global(const std::string& path, const oracle::Voxels& voxels,
                                      uint32_t hash_bits = 64) {
  return write_global(path, oracle::build_dag(voxels, static_cast<int>(hash_bits)),
                      grid_of(voxels.edge()), hash_bits);
}

}  // namespace voxdag
