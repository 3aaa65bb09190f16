// Small files with shared nodes, and their voxels, for tests of query/.
#pragma once

#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

#include "tests/unit/core/format/test_files.h"
#include "voxdag/query.h"

// Writes a file of these voxels, and finds the set cells of each level by brute force.
class QueryFile {
 public:
  using Cells = std::set<voxdag::query::Position>;  // in lexicographic order

  // A level of more than `narrow_words` words is wide: pointers to its nodes have 64 bits.
  explicit QueryFile(const oracle::Voxels& voxels,
                     uint64_t narrow_words = voxdag::global_layout::kNarrowLevelWords)
      : levels_(voxdag::levels_of_resolution(static_cast<uint64_t>(voxels.edge()))) {
    voxdag::write_global(path(), oracle::build_dag(voxels, 64), voxdag::grid_of(voxels.edge()), 64,
                         narrow_words);
    for (int x = 0; x < voxels.edge(); ++x)
      for (int y = 0; y < voxels.edge(); ++y)
        for (int z = 0; z < voxels.edge(); ++z)
          if (voxels.at(x, y, z)) voxels_.insert({x, y, z});
  }

  std::string path() const { return folder_.file("scene.vdag"); }
  uint32_t grid_levels() const { return levels_; }
  // Returns the set cells of the grid of 2^grid_levels cells per edge.
  Cells cells(uint32_t grid_levels) const {
    Cells cells;
    const uint32_t shift = levels_ - grid_levels;
    for (const auto& [x, y, z] : voxels_) cells.insert({x >> shift, y >> shift, z >> shift});
    return cells;
  }

 private:
  voxdag::TemporaryFolder folder_;
  uint32_t levels_;
  Cells voxels_;
};

// Checks that lookups find these cells of the grid of 2^grid_levels cells per edge, with one thread
// and with four.
inline void expect_lookups(const voxdag::query::DagFile& dag, uint32_t grid_levels,
                           const std::vector<voxdag::query::Position>& points,
                           const QueryFile::Cells& cells) {
  std::vector<uint8_t> set(points.size(), 7), set_by_four(points.size(), 7);
  dag.lookup(points, grid_levels, set);
  dag.lookup(points, grid_levels, set_by_four, 4);
  EXPECT_EQ(set, set_by_four);
  for (size_t i = 0; i < points.size(); ++i)
    ASSERT_EQ(set[i], cells.contains(points[i]) ? 1 : 0) << "point " << i;
}
