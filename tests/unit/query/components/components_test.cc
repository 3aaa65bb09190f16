// The components of a file equal the components that a flood fill over all voxels finds.
#include "query/components/components.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "core/format/global/open_global.h"
#include "tests/support/error_of.h"
#include "tests/unit/core/format/test_files.h"

namespace voxdag::query {
namespace {

// Returns all components, in the order of ComponentsReport::largest.
std::vector<Component> flooded(const oracle::Voxels& voxels, Connectivity connectivity) {
  const int edge = voxels.edge();
  oracle::Voxels seen(edge);
  std::vector<Component> components;
  for (int x = 0; x < edge; ++x)
    for (int y = 0; y < edge; ++y)
      for (int z = 0; z < edge; ++z) {
        if (!voxels.at(x, y, z) || seen.at(x, y, z)) continue;
        Component component;
        std::vector<std::array<int, 3>> waiting{{x, y, z}};
        seen.set(x, y, z);
        while (!waiting.empty()) {
          const std::array<int, 3> at = waiting.back();
          waiting.pop_back();
          ++component.voxels;
          for (size_t axis = 0; axis < 3; ++axis) {
            const auto i = static_cast<uint32_t>(at[axis]);
            component.low[axis] = std::min(component.low[axis], i);
            component.high[axis] = std::max(component.high[axis], i + 1);
          }
          for (int d = 0; d < 27; ++d) {
            const int step[3] = {d / 9 - 1, d / 3 % 3 - 1, d % 3 - 1};
            const int distance = std::abs(step[0]) + std::abs(step[1]) + std::abs(step[2]);
            if (connectivity == Connectivity::kFaces && distance > 1) continue;
            const std::array<int, 3> to{at[0] + step[0], at[1] + step[1], at[2] + step[2]};
            if (*std::ranges::min_element(to) < 0 || *std::ranges::max_element(to) >= edge)
              continue;
            if (!voxels.at(to[0], to[1], to[2]) || seen.at(to[0], to[1], to[2])) continue;
            seen.set(to[0], to[1], to[2]);
            waiting.push_back(to);
          }
        }
        components.push_back(component);
      }
  std::ranges::sort(components, [](const Component& a, const Component& b) {
    if (a.voxels != b.voxels) return a.voxels > b.voxels;
    return a.low != b.low ? a.low < b.low : a.high < b.high;
  });
  return components;
}

class Components : public testing::Test {
 protected:
  ComponentsReport find(const ComponentRule& rule, uint64_t memory_bytes = uint64_t{1} << 30) {
    MemoryBudget budget(memory_bytes);
    NoProgress progress;
    const auto file = open_global_file(folder_.file("a"));
    const ComponentsReport report = find_components(*file, rule, budget, progress, never_);
    EXPECT_EQ(budget.used(), 0);
    return report;
  }
  void expect_components(const oracle::Voxels& voxels) {
    write_global(folder_.file("a"), voxels);
    for (const Connectivity connectivity : {Connectivity::kFaces, Connectivity::kCorners})
      for (const size_t largest : {size_t{0}, size_t{3}, size_t{100000}}) {
        SCOPED_TRACE(largest);
        std::vector<Component> expected = flooded(voxels, connectivity);
        const ComponentsReport report = find({connectivity, largest});
        EXPECT_EQ(report.components, expected.size());
        expected.resize(std::min(expected.size(), largest));
        EXPECT_TRUE(report.largest == expected);
      }
  }

  TemporaryFolder folder_;
  CancelToken never_;
};

oracle::Voxels scattered(uint64_t seed, int edge, int64_t rarity) {
  oracle::Random random(seed);
  oracle::Voxels voxels(edge);
  for (int x = 0; x < edge; ++x)
    for (int y = 0; y < edge; ++y)
      for (int z = 0; z < edge; ++z)
        if (random.between(0, rarity) == 0) voxels.set(x, y, z);
  return voxels;
}

TEST_F(Components, OfScatteredVoxels) {
  for (const int edge : {4, 8, 16, 32})
    for (const int64_t rarity : {1, 2, 3, 5, 9, 30})
      expect_components(scattered(static_cast<uint64_t>(rarity), edge, rarity));
}

TEST_F(Components, OfBoxesAndSurfaces) {
  for (uint64_t seed = 0; seed < 8; ++seed) expect_components(random_voxels(seed, 64));
}

TEST_F(Components, OfEmptyAndFullGrids) {
  for (const int edge : {4, 16, 64}) {
    oracle::Voxels voxels(edge);
    expect_components(voxels);
    for (int x = 0; x < edge; ++x)
      for (int y = 0; y < edge; ++y)
        for (int z = 0; z < edge; ++z) voxels.set(x, y, z);
    expect_components(voxels);
  }
}

// A path that winds through the complete grid is one component.
TEST_F(Components, OfAWindingPath) {
  oracle::Voxels path(32);
  for (int y = 0; y < 32; y += 2) {
    for (int x = 0; x < 32; ++x) path.set(x, y, 7);
    if (y + 2 < 32) path.set(y % 4 == 0 ? 31 : 0, y + 1, 7);
  }
  expect_components(path);
  EXPECT_EQ(find({Connectivity::kFaces, 1}).components, 1);
}

// With connections by faces, each voxel of a checkerboard is a component.
TEST_F(Components, OfACheckerboard) {
  oracle::Voxels voxels(64);
  for (int x = 0; x < 64; ++x)
    for (int y = 0; y < 64; ++y)
      for (int z = 0; z < 64; ++z)
        if ((x + y + z) % 2 == 0) voxels.set(x, y, z);
  expect_components(voxels);
}

// Connections by edges and corners across the middle of the grid.
TEST_F(Components, OfDiagonals) {
  oracle::Voxels diagonals(16);
  for (int i = 0; i < 16; ++i) {
    diagonals.set(i, i, i);
    diagonals.set(15 - i, i, 3);
  }
  expect_components(diagonals);
  EXPECT_EQ(find({Connectivity::kCorners, 1}).components, 2);
}

// Less memory changes the time, but not the result. Too little memory is an error.
TEST_F(Components, LittleMemory) {
  const oracle::Voxels voxels = scattered(5, 64, 4);
  write_global(folder_.file("a"), voxels);
  const ComponentRule rule{Connectivity::kCorners, 20};
  const ComponentsReport all = find(rule);
  const ComponentsReport less = find(rule, uint64_t{4} << 20);
  EXPECT_EQ(all.components, less.components);
  EXPECT_TRUE(all.largest == less.largest);
  EXPECT_EQ(error_of([&] { find(rule, uint64_t{64} << 10); }).code(), ErrorCode::kOutOfMemory);
}

TEST_F(Components, Damage) {
  write_global(folder_.file("a"), random_voxels(3, 64));
  const std::string intact = read_bytes(folder_.file("a"));
  const auto file = open_global_file(folder_.file("a"));
  for (uint32_t level = 0; level <= file->brick_level(); ++level) {
    std::string damaged = intact;
    const size_t at = file->level(level).file_offset + 4 * (file->level(level).word_count / 2);
    damaged[at] = static_cast<char>(damaged[at] ^ 4);
    write_bytes(folder_.file("a"), damaged);
    EXPECT_EQ(error_of([&] { find({}); }).code(), ErrorCode::kCorrupt);
  }
}

}  // namespace
}  // namespace voxdag::query
