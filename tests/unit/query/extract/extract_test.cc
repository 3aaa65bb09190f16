// An extract has the bytes of the file that the oracle makes from the same voxels.
#include <array>

#include "tests/unit/query/extract/extract_fixture.h"

namespace voxdag::query {
namespace {

// Returns a scene in which each voxel is set with a probability of 1/2, so that almost no two
// bricks are equal.
oracle::Voxels noise(uint64_t seed, int edge) {
  std::mt19937_64 random(seed);
  oracle::Voxels voxels(edge);
  for (int x = 0; x < edge; ++x)
    for (int y = 0; y < edge; ++y)
      for (int z = 0; z < edge; ++z)
        if (random() & 1) voxels.set(x, y, z);
  return voxels;
}

// Returns a random box that is not empty, in a grid of 2^levels cells per edge.
Region any_region(oracle::Random& random, uint32_t levels) {
  const int64_t edge = int64_t{1} << levels;
  Region region;
  for (size_t axis = 0; axis < 3; ++axis) {
    const int64_t a = random.between(0, edge), b = random.between(0, edge);
    region.low[axis] = std::min(a, b);
    region.high[axis] = std::max(a, b);
    if (region.low[axis] == region.high[axis])
      region.low[axis] == edge ? --region.low[axis] : ++region.high[axis];
  }
  return region;
}

// Extracts of all levels have the bytes of the oracle's file, from the level of a single brick to
// the input's level, with full and with truncated hashes.
TEST_F(Extract, Levels) {
  const oracle::Voxels voxels = random_voxels(1, 128);
  for (const uint32_t hash_bits : {64u, 4u}) {
    write_global(path("in.vdag"), voxels, hash_bits);
    for (uint32_t levels = 2; levels <= 7; ++levels) {
      SCOPED_TRACE(testing::Message() << "level " << levels << ", hash bits " << hash_bits);
      extract_file("in.vdag", spec("out.vdag", {levels, whole_grid(levels)}));
      Grid grid = grid_of(128);
      grid.levels = levels;
      write_global(path("expected.vdag"),
                   oracle::build_dag(coarser(voxels, levels), static_cast<int>(hash_bits)), grid,
                   hash_bits);
      EXPECT_TRUE(bytes("out.vdag") == bytes("expected.vdag"));
    }
    EXPECT_TRUE(bytes("out.vdag") == bytes("in.vdag"));
  }
  EXPECT_EQ(warnings_.texts, std::vector<std::string>());
}

// Extracts of random boxes have the bytes of the oracle's file, with the complete grid and cropped.
TEST_F(Extract, Regions) {
  const oracle::Voxels voxels = random_voxels(2, 64);
  write_global(path("in.vdag"), voxels);
  oracle::Random random(3);
  for (int i = 0; i < 24; ++i) {
    const auto levels = static_cast<uint32_t>(random.between(2, 6));
    const Region region = any_region(random, levels);
    SCOPED_TRACE(testing::Message() << "try " << i << ", level " << levels);
    const oracle::Voxels cells = coarser(voxels, levels);
    Grid grid = grid_of(64);
    grid.levels = levels;
    extract_file("in.vdag", spec("out.vdag", {levels, region}));
    write_global(path("expected.vdag"),
                 oracle::build_dag(part_of(cells, region, {}, 1 << levels), 64), grid);
    ASSERT_TRUE(bytes("out.vdag") == bytes("expected.vdag"));

    const Cube cube = crop_cube({levels, region});
    const int edge = 1 << (levels - cube.level);
    std::array<int64_t, 3> low;
    for (size_t axis = 0; axis < 3; ++axis) {
      low[axis] = int64_t{cube.position[axis]} * edge;
      grid.origin[axis] += cube.position[axis] * (grid.edge / (1 << cube.level));
    }
    grid.edge /= 1 << cube.level;
    grid.levels -= cube.level;
    extract_file("in.vdag", spec("out.vdag", {levels, region}, true));
    write_global(path("expected.vdag"), oracle::build_dag(part_of(cells, region, low, edge), 64),
                 grid);
    ASSERT_TRUE(bytes("out.vdag") == bytes("expected.vdag"));
  }
}

// The crop cube is the smallest aligned cube around the region, and has at least the size of a
// brick.
TEST_F(Extract, CropCube) {
  EXPECT_EQ(crop_cube({6, whole_grid(6)}), Cube{});
  EXPECT_EQ(crop_cube({6, {{31, 0, 0}, {33, 1, 1}}}), Cube{});
  EXPECT_EQ(crop_cube({6, {{9, 17, 63}, {10, 18, 64}}}), (Cube{4, {2, 4, 15}}));
  EXPECT_EQ(crop_cube({6, {{8, 16, 8}, {16, 24, 16}}}), (Cube{3, {1, 2, 1}}));
  EXPECT_EQ(crop_cube({2, {{1, 1, 1}, {2, 2, 2}}}), Cube{});
}

// Extracting in several steps gives the same bytes as extracting the same voxels in one step.
TEST_F(Extract, InSteps) {
  write_global(path("in.vdag"), random_voxels(4, 128));
  extract_file("in.vdag", spec("half.vdag", {6, whole_grid(6)}));
  extract_file("half.vdag", spec("quarter.vdag", {5, whole_grid(5)}));
  extract_file("in.vdag", spec("direct.vdag", {5, whole_grid(5)}));
  EXPECT_TRUE(bytes("quarter.vdag") == bytes("direct.vdag"));

  const Region box{{16, 32, 0}, {96, 112, 64}}, coarse_box{{4, 8, 0}, {24, 28, 16}};
  extract_file("in.vdag", spec("box.vdag", {7, box}));
  extract_file("box.vdag", spec("box_then_level.vdag", {5, whole_grid(5)}));
  extract_file("in.vdag", spec("level_of_box.vdag", {5, coarse_box}));
  extract_file("quarter.vdag", spec("level_then_box.vdag", {5, coarse_box}));
  EXPECT_TRUE(bytes("box_then_level.vdag") == bytes("level_of_box.vdag"));
  EXPECT_TRUE(bytes("level_then_box.vdag") == bytes("level_of_box.vdag"));

  const Region inner{{20, 33, 7}, {50, 99, 60}};
  extract_file("box.vdag", spec("box_in_box.vdag", {7, inner}));
  extract_file("in.vdag", spec("inner.vdag", {7, inner}));
  EXPECT_TRUE(bytes("box_in_box.vdag") == bytes("inner.vdag"));
}

// The bytes are the same for any number of threads and for any memory. With little memory, cubes
// are divided, because they do not fit in their share of the memory.
TEST_F(Extract, MemoryAndThreads) {
  const oracle::Voxels voxels = noise(5, 128);
  write_global(path("in.vdag"), voxels);
  const Region region{{1, 2, 3}, {127, 128, 120}};
  ExtractSpec ample = spec("ample.vdag", {7, region});
  ample.memory_bytes = uint64_t{1} << 30;
  const ExtractReport once = extract_file("in.vdag", ample);
  EXPECT_EQ(once.parts_split, 0u);
  for (const unsigned threads : {1u, 3u}) {
    ExtractSpec small = spec("small.vdag", {7, region});
    small.memory_bytes = uint64_t{12} << 20;
    small.threads = threads;
    const ExtractReport report = extract_file("in.vdag", small);
    EXPECT_GT(report.parts_split, 0u);
    EXPECT_EQ(report.sha256, once.sha256);
  }
  ExtractSpec whole = spec("whole.vdag", {7, whole_grid(7)});
  whole.threads = 5;
  extract_file("in.vdag", whole);
  EXPECT_TRUE(bytes("whole.vdag") == bytes("in.vdag"));
}

// Extracts read inputs with wide levels (levels to which pointers have 64 bits). They write a level
// as wide if it has more than `narrow_words` words.
TEST_F(Extract, WideLevels) {
  const oracle::Voxels voxels = random_voxels(6, 64);
  const oracle::Dag dag = oracle::build_dag(voxels, 64);
  for (const uint64_t narrow_words : {uint64_t{1}, uint64_t{40}, uint64_t{100}}) {
    SCOPED_TRACE(narrow_words);
    write_global(path("in.vdag"), dag, grid_of(64), 64, narrow_words);
    EXPECT_EQ(open_global_file(path("in.vdag"))->version(), 2u);
    for (uint32_t levels = 3; levels <= 6; ++levels) {
      ExtractSpec wide = spec("wide.vdag", {levels, whole_grid(levels)});
      wide.narrow_words = narrow_words;
      extract_file("in.vdag", wide);
      Grid grid = grid_of(64);
      grid.levels = levels;
      write_global(path("expected.vdag"), oracle::build_dag(coarser(voxels, levels), 64), grid, 64,
                   narrow_words);
      EXPECT_TRUE(bytes("wide.vdag") == bytes("expected.vdag")) << levels;
    }
  }
  extract_file("in.vdag", spec("narrow.vdag", {6, whole_grid(6)}));
  EXPECT_EQ(open_global_file(path("narrow.vdag"))->version(), 1u);
}

// An extract without voxels is a valid file without nodes, and the extract warns.
TEST_F(Extract, Nothing) {
  oracle::Voxels voxels(32);
  voxels.set(1, 1, 1);
  write_global(path("in.vdag"), voxels);
  write_global(path("empty.vdag"), oracle::Voxels(32));
  const Region far{{16, 16, 16}, {32, 32, 32}}, near{{2, 0, 0}, {4, 4, 4}};
  for (const auto& [input, region, crop] :
       {std::tuple{"in.vdag", far, false}, std::tuple{"in.vdag", far, true},
        std::tuple{"in.vdag", near, false}, std::tuple{"in.vdag", near, true},
        std::tuple{"empty.vdag", whole_grid(5), false}}) {
    warnings_.texts.clear();
    const ExtractReport report = extract_file(input, spec("out.vdag", {5, region}, crop));
    EXPECT_EQ(report.voxels, 0u);
    EXPECT_EQ(report.bytes, 4096u);
    EXPECT_EQ(warnings_.texts.size(), 1u);
  }
}

}  // namespace
}  // namespace voxdag::query
