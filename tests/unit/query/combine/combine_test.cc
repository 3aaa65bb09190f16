// Tests that a combined file has the bytes of the oracle's file of the combined voxels.
#include <array>

#include "tests/unit/query/combine/combine_fixture.h"

namespace voxdag::query {
namespace {

// Returns `voxels`, and additionally all voxels of a small box.
oracle::Voxels with_box(const oracle::Voxels& voxels, uint64_t seed) {
  oracle::Random random(seed);
  const int edge = voxels.edge();
  const auto at = [&] { return static_cast<int>(random.between(0, edge - 1)); };
  const std::array<int, 3> cut = {at(), at(), at()};
  oracle::Voxels changed = voxels;
  fill(changed, cut, {std::min(cut[0] + 3, edge), std::min(cut[1] + 5, edge), cut[2] + 1});
  return changed;
}

// Returns two scenes. Depending on `seed`, they are random, differ by a small box, or both contain
// large full cubes.
std::array<oracle::Voxels, 2> scenes(uint64_t seed, int edge) {
  std::array<oracle::Voxels, 2> scenes = {random_voxels(seed, edge), random_voxels(seed + 1, edge)};
  if (seed % 3 == 1) scenes[1] = with_box(scenes[0], seed);
  if (seed % 3 == 2)
    for (size_t i = 0; i < 2; ++i) {
      const int half = edge / 2, from = i == 0 ? 0 : edge / 4;
      fill(scenes[i], {from, 0, 0}, {from + half, half, edge});
    }
  return scenes;
}

// All operations give the bytes of the oracle's file, in grids from a single brick up to 64^3
// voxels, with full and with truncated hashes.
TEST_F(Combine, EqualsTheOracle) {
  for (const int edge : {4, 8, 64})
    for (uint64_t seed = 0; seed < 3; ++seed)
      for (const uint32_t hash_bits : {64u, 4u}) {
        if (hash_bits == 4 && seed != 2) continue;
        const auto [a, b] = scenes(100 * static_cast<uint64_t>(edge) + seed, edge);
        write_global(path("a.vdag"), a, hash_bits);
        write_global(path("b.vdag"), b, hash_bits);
        for (const Operation operation : kAllOperations) {
          SCOPED_TRACE(testing::Message() << "edge " << edge << ", seed " << seed << ", hash bits "
                                          << hash_bits << ", " << static_cast<int>(operation));
          write_global(path("expected.vdag"), combined_voxels(operation, a, b), hash_bits);
          ASSERT_TRUE(combined("a.vdag", operation, "b.vdag", "c.vdag") == bytes("expected.vdag"));
        }
      }
}

// Combines files without voxels, and files whose combination has no voxels. Each empty result gives
// a warning.
TEST_F(Combine, EmptyFiles) {
  write_global(path("a.vdag"), random_voxels(3, 32));
  write_global(path("empty.vdag"), oracle::Voxels(32));
  const std::string a = bytes("a.vdag"), empty = bytes("empty.vdag");
  for (const Operation operation : {Operation::kUnion, Operation::kMinus, Operation::kXor})
    EXPECT_TRUE(combined("a.vdag", operation, "empty.vdag", "c.vdag") == a);
  for (const Operation operation : {Operation::kUnion, Operation::kXor})
    EXPECT_TRUE(combined("empty.vdag", operation, "a.vdag", "c.vdag") == a);
  EXPECT_EQ(warnings_.texts, std::vector<std::string>());
  EXPECT_TRUE(combined("empty.vdag", Operation::kMinus, "a.vdag", "c.vdag") == empty);
  EXPECT_TRUE(combined("empty.vdag", Operation::kAnd, "a.vdag", "c.vdag") == empty);
  EXPECT_TRUE(combined("a.vdag", Operation::kXor, "a.vdag", "c.vdag") == empty);
  for (const Operation operation : kAllOperations)
    EXPECT_TRUE(combined("empty.vdag", operation, "empty.vdag", "c.vdag") == empty);
  EXPECT_EQ(warnings_.texts.size(), 7u);
  EXPECT_EQ(warnings_.texts[0], "the result has no voxels: the file will have no nodes");
}

TEST_F(Combine, Identities) {
  write_global(path("a"), random_voxels(4, 64));
  write_global(path("b"), random_voxels(5, 64));
  oracle::Voxels full(64);
  fill(full, {0, 0, 0}, {64, 64, 64});
  write_global(path("all"), full);
  EXPECT_TRUE(combined("a", Operation::kUnion, "a", "c") == bytes("a"));
  EXPECT_TRUE(combined("a", Operation::kAnd, "a", "c") == bytes("a"));
  combined("a", Operation::kUnion, "b", "either");
  combined("a", Operation::kMinus, "b", "only_a");
  combined("b", Operation::kMinus, "a", "only_b");
  combined("a", Operation::kAnd, "b", "both");
  EXPECT_TRUE(combined("b", Operation::kUnion, "a", "c") == bytes("either"));
  EXPECT_TRUE(combined("either", Operation::kMinus, "b", "c") == bytes("only_a"));
  EXPECT_TRUE(combined("either", Operation::kMinus, "both", "c") ==
              combined("a", Operation::kXor, "b", "d"));
  EXPECT_TRUE(combined("only_a", Operation::kUnion, "only_b", "c") == bytes("d"));
  // De Morgan: the complement of the union is the intersection of the complements.
  combined("all", Operation::kMinus, "a", "not_a");
  combined("all", Operation::kXor, "b", "not_b");
  EXPECT_TRUE(combined("not_a", Operation::kAnd, "not_b", "c") ==
              combined("all", Operation::kMinus, "either", "d"));
}

// combine() visits pairs of nodes: one node of each file, for the same cube of the grid. It does
// not visit the children of two equal nodes, so files that differ in one voxel have few pairs.
TEST_F(Combine, FewPairsOfSimilarFiles) {
  const oracle::Voxels a = random_voxels(6, 128);
  oracle::Voxels b = a;
  b.set(77, 5, 100);
  write_global(path("a"), a);
  write_global(path("b"), b);
  EXPECT_LE(combine_files("a", "b", spec(Operation::kUnion, "c")).pairs, 6u);
  EXPECT_TRUE(bytes("c") == bytes("b"));
  EXPECT_EQ(combine_files("a", "a", spec(Operation::kXor, "c")).pairs, 0u);
}

// With so little memory that lists are in scratch files, the bytes are the same.
TEST_F(Combine, LittleMemory) {
  const auto [a, b] = scenes(200, 64);
  write_global(path("a"), a);
  write_global(path("b"), b);
  for (const Operation operation : kAllOperations) {
    const CombineReport plenty = combine_files("a", "b", spec(operation, "c"));
    EXPECT_EQ(plenty.work_bytes, 0u);
    CombineSpec little = spec(operation, "d");
    little.list_bytes = 256;
    EXPECT_GT(combine_files("a", "b", little).work_bytes, 0u);
    EXPECT_TRUE(bytes("c") == bytes("d"));
  }
}

// Inputs and results can have wide levels (levels to which pointers have 64 bits).
TEST_F(Combine, WideLevels) {
  const auto [a, b] = scenes(300, 64);
  const uint64_t narrow_words = 64;
  const auto write = [&](const std::string& name, const oracle::Voxels& voxels) {
    write_global(path(name), oracle::build_dag(voxels, 64), grid_of(64), 64, narrow_words);
  };
  write("a", a);
  write("b", b);
  for (const Operation operation : kAllOperations) {
    write("expected", combined_voxels(operation, a, b));
    CombineSpec wide = spec(operation, "c");
    wide.narrow_words = narrow_words;
    combine_files("a", "b", wide);
    EXPECT_TRUE(bytes("c") == bytes("expected"));
  }
}

TEST_F(Combine, RefusesOtherGrids) {
  write_global(path("a"), random_voxels(1, 32));
  write_global(path("small"), random_voxels(1, 16));
  write_global(path("truncated"), random_voxels(1, 32), 16);
  Grid moved = grid_of(32);
  moved.origin[1] += 1;
  write_global(path("moved"), oracle::build_dag(random_voxels(1, 32), 64), moved);
  const auto message = [&](const std::string& b) {
    const auto file_a = open_global_file(path("a")), file_b = open_global_file(path(b));
    const Error error = error_of([&] {
      combine(*file_a, *file_b, spec(Operation::kUnion, "c"), system_files(), warnings_, never_);
    });
    EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
    return error.message();
  };
  for (const char* other : {"small", "moved"})
    EXPECT_TRUE(message(other).starts_with("only files of the same grid can be combined"));
  EXPECT_TRUE(message("truncated").starts_with("only files with equal hash bits"));
  expect_files({"a", "small", "truncated", "moved"});
}

}  // namespace
}  // namespace voxdag::query
