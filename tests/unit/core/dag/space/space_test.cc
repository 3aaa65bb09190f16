// Compares the components of empty space, and the fill of enclosed space, with a flood fill of
// single voxels.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <optional>
#include <random>
#include <vector>

#include "core/base/memory_budget.h"
#include "core/dag/space/face_code.h"
#include "tests/unit/core/dag/space/space_dag.h"
#include "voxdag/error.h"

namespace voxdag {
namespace {

const std::string kFaceFile = "faces";  // the file that errors of FaceReader name

TEST(Space, NeighborsInABrick) {
  for (int bit = 0; bit < 64; ++bit) {
    uint64_t expected = 0;
    for (int other = 0; other < 64; ++other) {
      int distance = 0;
      for (int a = 0; a < 3; ++a)
        distance += std::abs(brick_coordinate(bit, a) - brick_coordinate(other, a));
      if (distance == 1) expected |= uint64_t{1} << other;
    }
    EXPECT_EQ(brick_neighbors(uint64_t{1} << bit), expected) << bit;
  }
  for (int axis = 0; axis < 3; ++axis)
    EXPECT_EQ(brick_face(2 * axis + 1) >> brick_face_shift(axis), brick_face(2 * axis));
}

TEST(Space, FillSetsWhatTheBorderDoesNotReach) {
  for (const int edge : {4, 8, 16, 32})
    for_random_grids(edge, [](const SpaceGrid& grid) {
      SpaceDag dag(grid);
      const SpaceGrid filled = dag.fill(std::vector<uint8_t>(dag.components(), 1));
      SpaceGrid expected = outside_of(grid);
      for (uint8_t& voxel : expected.voxels) voxel = !voxel;
      ASSERT_EQ(filled.voxels, expected.voxels);
      EXPECT_EQ(dag.summary.voxels, static_cast<uint64_t>(std::ranges::count(filled.voxels, 1)));
    });
}

// A seed fills its component and no other one, whether the component reaches the cube's faces or
// not.
TEST(Space, SeedFillsItsComponent) {
  std::mt19937 engine(5);
  std::array<int, 3> kinds{};
  for (const int edge : {4, 8, 16, 32})
    for_random_grids(edge, [&](const SpaceGrid& grid) {
      SpaceDag dag(grid);
      const SpaceGrid outside = outside_of(grid);
      for (int i = 0; i < 12; ++i) {
        const auto any = [&] { return static_cast<int>(engine() % static_cast<unsigned>(edge)); };
        const SpaceCell seed{any(), any(), any()};
        SpaceGrid expected(grid.size);
        flood(grid, seed, expected);
        for (size_t v = 0; v < grid.voxels.size(); ++v) expected.voxels[v] |= grid.voxels[v];
        ASSERT_EQ(dag.fill_seed(seed).voxels, expected.voxels);
        EXPECT_EQ(dag.summary.voxels,
                  static_cast<uint64_t>(std::ranges::count(expected.voxels, 1)));
        const auto kind = grid.at(seed)      ? SeedPlace::Kind::kSet
                          : outside.at(seed) ? SeedPlace::Kind::kOpen
                                             : SeedPlace::Kind::kClosed;
        ASSERT_EQ(dag.place.kind, kind);
        ++kinds[static_cast<size_t>(kind)];
      }
    });
  for (const int count : kinds) EXPECT_GT(count, 20);
}

// The components are disjoint, each is connected, and together they are the outside: all empty
// voxels that are connected to a face of the cube.
TEST(Space, EachComponentIsConnected) {
  for (const int edge : {4, 8, 16})
    for_random_grids(edge, [](const SpaceGrid& grid) {
      SpaceDag dag(grid);
      const SpaceGrid outside = outside_of(grid);
      SpaceGrid all(grid.size);
      for (uint32_t c = 0; c < dag.components(); ++c) {
        const SpaceGrid component = dag.component(c);
        uint8_t touch = 0;
        bool is_first = true;
        SpaceGrid reached(grid.size);
        grid.for_each([&](const SpaceCell& cell) {
          if (!component.at(cell)) return;
          if (std::exchange(is_first, false)) flood(grid, cell, reached);
          ++all.at(cell);
          for (int a = 0; a < 3; ++a) {
            if (cell[a] == 0) touch = static_cast<uint8_t>(touch | 1 << 2 * a);
            if (cell[a] == grid.size[a] - 1) touch = static_cast<uint8_t>(touch | 2 << 2 * a);
          }
        });
        ASSERT_EQ(reached.voxels, component.voxels);
        ASSERT_EQ(dag.labels().touch(0, 0)[c], touch);
      }
      ASSERT_EQ(all.voxels, outside.voxels);
    });
}

// If the only component counts as outside, nothing is filled. Otherwise all voxels are set.
TEST(Space, FullCube) {
  SpaceGrid grid(64);
  grid.at({40, 3, 5}) = 1;
  SpaceDag dag(grid);
  ASSERT_EQ(dag.components(), 1u);
  EXPECT_EQ(dag.fill({1}).voxels, grid.voxels);
  EXPECT_EQ(dag.summary.dag_nodes, 5u);
  EXPECT_EQ(std::ranges::count(dag.fill({0}).voxels, 1), 64 * 64 * 64);
  EXPECT_EQ(dag.summary.voxels, 64u * 64 * 64);
  EXPECT_EQ(dag.summary.svo_nodes, 1u + 8 + 64 + 512 + 4096);
  EXPECT_EQ(dag.summary.dag_nodes, 5u);
}

// Tests a cube with more than 64 components, which is more than FilledNode::outside has bits.
TEST(Space, ManyComponents) {
  SpaceGrid grid(32);
  grid.for_each([&](const SpaceCell& c) { grid.at(c) = (c[0] + c[1] + c[2]) % 2 == 0; });
  SpaceDag dag(grid);
  const uint32_t expected = (32 * 32 * 32 - 30 * 30 * 30) / 2;
  ASSERT_EQ(dag.components(), expected);
  EXPECT_EQ(dag.fill(std::vector<uint8_t>(expected, 1)).voxels, [&] {
    SpaceGrid filled = outside_of(grid);
    for (uint8_t& voxel : filled.voxels) voxel = !voxel;
    return filled.voxels;
  }());
  std::vector<uint8_t> half(expected);
  for (uint32_t c = 0; c < expected; c += 2) half[c] = 1;
  EXPECT_EQ(std::ranges::count(dag.fill(half).voxels, 0), expected / 2);
}

SpaceGrid part_of(const SpaceGrid& grid, const SpaceCell& low, int edge) {
  SpaceGrid out(edge);
  out.for_each([&](const SpaceCell& c) {
    out.at(c) = grid.at({low[0] + c[0], low[1] + c[1], low[2] + c[2]});
  });
  return out;
}

// Two cubes have a common face. join_squares() must join two of their components if and only if a
// walk through empty voxels of both cubes connects them.
void expect_joined(const SpaceGrid& grid, int axis, int edge) {
  SpaceCell high{0, 0, 0};
  high[axis] = edge;
  SpaceDag parts[2] = {SpaceDag(part_of(grid, {0, 0, 0}, edge)),
                       SpaceDag(part_of(grid, high, edge))};
  const uint32_t first[2] = {0, parts[0].components()};
  std::vector<uint32_t> set(first[1] + parts[1].components());
  for (uint32_t i = 0; i < set.size(); ++i) set[i] = i;
  const auto low_face = encode_face(parts[0].labels(), 2 * axis + 1, UINT64_MAX);
  const auto high_face = encode_face(parts[1].labels(), 2 * axis, UINT64_MAX);
  FaceReader a(kFaceFile, low_face), b(kFaceFile, high_face);
  const auto square_a = a.next(), square_b = b.next();
  join_squares(a, square_a, b, square_b, [&](uint32_t i, uint32_t j) {
    const uint32_t from = set[i], to = set[first[1] + j];
    for (uint32_t& s : set)
      if (s == from) s = to;
  });
  // For each voxel of a component: 1 + the number of the set of joined components to which the
  // component belongs. 0 for all other voxels.
  std::vector<uint32_t> sets(grid.voxels.size());
  SpaceGrid walked(grid.size);
  for (int p = 0; p < 2; ++p)
    for (uint32_t c = 0; c < parts[p].components(); ++c) {
      const SpaceGrid component = parts[p].component(c);
      component.for_each([&](const SpaceCell& cell) {
        SpaceCell at = cell;
        at[axis] += p * edge;
        if (component.at(cell)) sets[grid.index(at)] = set[first[p] + c] + 1;
      });
    }
  grid.for_each([&](const SpaceCell& c) {
    const uint32_t of_start = sets[grid.index(c)];
    if (of_start == 0 || walked.at(c)) return;
    SpaceGrid reached(grid.size);
    flood(grid, c, reached);
    grid.for_each([&](const SpaceCell& other) {
      const uint32_t of_other = sets[grid.index(other)];
      if (of_other != 0) {
        ASSERT_EQ(of_other == of_start, reached.at(other) == 1);
      }
      walked.at(other) |= reached.at(other);
    });
  });
}

TEST(Space, FacesJoinNeighbors) {
  std::mt19937 engine(1);
  for (const int edge : {4, 8, 16})
    for (int i = 0; i < 12; ++i) {
      SCOPED_TRACE(testing::Message() << "edge " << edge << ", grid " << i);
      SpaceCell size{edge, edge, edge};
      size[i % 3] *= 2;
      SpaceGrid grid = random_grid(engine, size, i % 2 != 0);
      grid.voxels.front() = grid.voxels.back() = 1;
      expect_joined(grid, i % 3, edge);
    }
}

// descend() follows a path of quadrants to a square of the face. If a larger square on the path is
// empty, descend() returns this square.
TEST(Space, FacesDescend) {
  SpaceGrid grid(16);
  grid.at({15, 2, 14}) = 1;  // in quadrant 1 of the high face along x
  SpaceDag dag(grid);
  const auto bytes = encode_face(dag.labels(), 1, UINT64_MAX);
  const uint8_t to_brick[] = {1, 1}, to_empty[] = {2, 1};
  FaceReader brick(kFaceFile, bytes), empty(kFaceFile, bytes);
  EXPECT_EQ(brick.descend(to_brick).kind, FaceReader::Kind::kBrick);
  EXPECT_EQ(empty.descend(to_empty).kind, FaceReader::Kind::kEmpty);
  EXPECT_EQ(empty_face().size(), 2u);
}

// The bytes claim that every square is split into quadrants, without end. Reading them is an error,
// and must not exhaust the stack.
TEST(Space, FacesOfAnyDepthAreRefused) {
  const std::vector<std::byte> split(1 << 20, static_cast<std::byte>(FaceReader::Kind::kSplit));
  const auto code_of = [](const auto& read) -> std::optional<ErrorCode> {
    try {
      read();
    } catch (const Error& e) {
      EXPECT_TRUE(std::string(e.what()).starts_with(kFaceFile)) << e.what();
      return e.code();
    }
    return std::nullopt;
  };
  EXPECT_EQ(ErrorCode::kCorrupt, code_of([&] {
              FaceReader reader(kFaceFile, split);
              reader.skip(reader.next());
            }));
  EXPECT_EQ(ErrorCode::kCorrupt, code_of([&] {
              FaceReader a(kFaceFile, split), b(kFaceFile, split);
              const auto square_a = a.next(), square_b = b.next();
              join_squares(a, square_a, b, square_b, [](uint32_t, uint32_t) {});
            }));
}

TEST(Space, MemoryIsLimited) {
  SpaceGrid grid(32);
  grid.for_each(
      [&](const SpaceCell& c) { grid.at(c) = (c[0] * 7 + c[1] * 5 + c[2] * 3) % 11 < 5; });
  SpaceDag dag(grid);
  EXPECT_THROW(encode_face(dag.labels(), 0, 10), OutOfBudget);
  MemoryBudget small(4096);
  PagePool pool;
  PooledMemory memory{small, pool};
  EXPECT_THROW(SpaceLabels(memory, dag.labels().levels()), OutOfBudget);
}

}  // namespace
}  // namespace voxdag
