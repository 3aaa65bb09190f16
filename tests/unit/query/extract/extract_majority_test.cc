// An extract by majority sets the cells in which at least half of the voxels are set. It has the
// bytes of the file that the oracle makes from these cells, counted voxel by voxel.
#include <bit>

#include "core/base/memory_budget.h"
#include "query/extract/majority_cells.h"
#include "tests/support/error_of.h"
#include "tests/unit/query/extract/extract_fixture.h"

namespace voxdag::query {
namespace {

// Returns the cells of the grid of 2^levels cells per edge in which at least half of the voxels are
// set.
oracle::Voxels majority_of(const oracle::Voxels& voxels, uint32_t levels) {
  const int edge = 1 << levels, size = voxels.edge() >> levels;
  std::vector<int> counts(static_cast<size_t>(edge) * edge * edge);
  const auto cell_at = [&](int x, int y, int z) -> int& {
    return counts[(static_cast<size_t>(x) * edge + y) * edge + z];
  };
  for (int x = 0; x < voxels.edge(); ++x)
    for (int y = 0; y < voxels.edge(); ++y)
      for (int z = 0; z < voxels.edge(); ++z)
        cell_at(x / size, y / size, z / size) += voxels.at(x, y, z);
  oracle::Voxels cells(edge);
  for (int x = 0; x < edge; ++x)
    for (int y = 0; y < edge; ++y)
      for (int z = 0; z < edge; ++z)
        if (2 * cell_at(x, y, z) >= size * size * size) cells.set(x, y, z);
  return cells;
}

// Returns a ball with a hole, and voxels that are set at random outside the ball.
oracle::Voxels solid(uint64_t seed, int edge) {
  std::mt19937_64 random(seed);
  oracle::Voxels voxels(edge);
  for (int x = 0; x < edge; ++x)
    for (int y = 0; y < edge; ++y)
      for (int z = 0; z < edge; ++z) {
        const int dx = x - edge / 2, dy = y - edge / 2, dz = z - edge / 2;
        const int squares = dx * dx + dy * dy + dz * dz;
        const bool inside = 9 * squares < edge * edge && 64 * squares > edge * edge;
        const bool noise = x < edge / 2 && random() % 16 < static_cast<uint64_t>(16 * z / edge);
        if (inside || noise) voxels.set(x, y, z);
      }
  return voxels;
}

class ExtractMajority : public Extract {
 protected:
  ExtractSpec majority(const Selection& selection) const {
    ExtractSpec result = spec("out.vdag", selection);
    result.majority = true;
    return result;
  }
  // Writes expected.vdag, the file that an extract of the selection by majority must equal.
  void write_expected(const oracle::Voxels& voxels, const Selection& selection,
                      int hash_bits = 64) {
    Grid grid = grid_of(voxels.edge());
    grid.levels = selection.grid_levels;
    const oracle::Voxels cells = majority_of(voxels, selection.grid_levels);
    write_global(path("expected.vdag"),
                 oracle::build_dag(part_of(cells, selection.region, {}, 1 << selection.grid_levels),
                                   hash_bits),
                 grid, static_cast<uint32_t>(hash_bits));
  }
};

TEST_F(ExtractMajority, AllLevels) {
  const oracle::Voxels voxels = solid(1, 64);
  for (const int hash_bits : {64, 4}) {
    write_global(path("in.vdag"), oracle::build_dag(voxels, hash_bits), grid_of(64),
                 static_cast<uint32_t>(hash_bits));
    for (uint32_t levels = 2; levels <= 6; ++levels) {
      SCOPED_TRACE(testing::Message() << "level " << levels << ", hash bits " << hash_bits);
      const Selection all{levels, whole_grid(levels)};
      extract_file("in.vdag", majority(all));
      write_expected(voxels, all, hash_bits);
      EXPECT_TRUE(bytes("out.vdag") == bytes("expected.vdag"));
    }
    EXPECT_TRUE(bytes("out.vdag") == bytes("in.vdag"));
  }
}

// A region selects cells, but all voxels of a cell count, even outside the region. This is also
// true if the region cuts nodes of the coarser grid.
TEST_F(ExtractMajority, Regions) {
  const oracle::Voxels voxels = solid(2, 64);
  write_global(path("in.vdag"), voxels);
  for (const Selection& part :
       {Selection{5, {{3, 4, 5}, {30, 21, 27}}}, Selection{4, {{1, 0, 7}, {16, 9, 14}}},
        Selection{3, {{2, 3, 1}, {7, 8, 8}}}}) {
    SCOPED_TRACE(part.grid_levels);
    extract_file("in.vdag", majority(part));
    write_expected(voxels, part);
    EXPECT_TRUE(bytes("out.vdag") == bytes("expected.vdag"));
  }
}

// A cell is set if exactly half of its voxels are set, and empty if one voxel less is set.
TEST_F(ExtractMajority, Ties) {
  for (uint32_t levels = 2; levels <= 4; ++levels) {
    SCOPED_TRACE(levels);
    const int size = 32 >> levels;
    oracle::Voxels voxels(32);
    for (int x = 0; x < size; ++x)
      for (int y = 0; y < size; ++y)
        for (int z = 0; z < size / 2; ++z) {
          voxels.set(x, y, z);
          if (x + y + z > 0) voxels.set(x + 2 * size, y, z);
        }
    write_global(path("in.vdag"), voxels);
    const Selection all{levels, whole_grid(levels)};
    EXPECT_EQ(extract_file("in.vdag", majority(all)).voxels, 1u);
    write_expected(voxels, all);
    EXPECT_TRUE(bytes("out.vdag") == bytes("expected.vdag"));
  }
}

// At a coarser level, the volume of a ball changes by less than 2 %. Without `majority`, it grows
// by over 20 %, because each touched cell is set.
TEST_F(ExtractMajority, KeepsTheVolume) {
  oracle::Voxels ball(64);
  for (int x = 0; x < 64; ++x)
    for (int y = 0; y < 64; ++y)
      for (int z = 0; z < 64; ++z)
        if ((x - 32) * (x - 32) + (y - 32) * (y - 32) + (z - 32) * (z - 32) < 900)
          ball.set(x, y, z);
  const double volume = static_cast<double>(ball.count());
  write_global(path("in.vdag"), ball);
  const Selection coarse{4, whole_grid(4)};
  EXPECT_NEAR(64.0 * static_cast<double>(extract_file("in.vdag", majority(coarse)).voxels), volume,
              0.02 * volume);
  EXPECT_GT(64.0 * static_cast<double>(extract_file("in.vdag", spec("out.vdag", coarse)).voxels),
            1.2 * volume);
}

// MajorityCells gives the same cells if its voxel counts do not fit in memory, so that it stores
// them in scratch files.
TEST_F(ExtractMajority, NumbersInScratchFiles) {
  const oracle::Voxels voxels = solid(3, 64);
  const oracle::Dag dag = oracle::build_dag(voxels, 64);
  write_global(path("in.vdag"), dag, grid_of(64), 64);
  const auto file = open_global_file(path("in.vdag"));
  ScratchFolder folder(system_files(), path("counts"));
  MemoryBudget large(uint64_t{64} << 20), small(uint64_t{48} << 10);
  const MajorityCells in_memory(*file, 3, folder, large, warnings_, never_);
  EXPECT_EQ(folder.bytes_written(), 0u);
  const MajorityCells on_disk(*file, 3, folder, small, warnings_, never_);
  EXPECT_GT(folder.bytes_written(), 0u);
  for (uint64_t at = 0; at < file->level(2).word_count;) {
    const voxdag_reader::Node node = file->node(2, at);
    EXPECT_EQ(in_memory.children(node), on_disk.children(node));
    at += 1 + static_cast<uint64_t>(std::popcount(node.child_mask));
  }
}

TEST_F(ExtractMajority, NoCellIsSet) {
  oracle::Voxels voxels(32);
  for (int i = 0; i < 32; ++i) voxels.set(i, 31 - i, i);
  write_global(path("in.vdag"), voxels);
  EXPECT_EQ(extract_file("in.vdag", majority({4, whole_grid(4)})).dag_nodes, 0u);
  ASSERT_EQ(warnings_.texts.size(), 1u);
  EXPECT_NE(warnings_.texts[0].find("half of its voxels"), std::string::npos);
  expect_files({"in.vdag", "out.vdag"});
}

}  // namespace
}  // namespace voxdag::query
