// A file that is combined at an offset has the bytes of the file that the oracle makes from the
// moved voxels.
#include "tests/unit/query/combine/combine_fixture.h"

namespace voxdag::query {
namespace {

using Offset = std::array<int64_t, 3>;

// Returns `voxels` moved by `offset`, in a grid of `edge` voxels per edge. Voxels outside this grid
// are dropped.
oracle::Voxels moved_voxels(const oracle::Voxels& voxels, const Offset& offset, int edge) {
  oracle::Voxels moved(edge);
  const auto is_inside = [&](int64_t i) { return i >= 0 && i < edge; };
  for (int x = 0; x < voxels.edge(); ++x)
    for (int y = 0; y < voxels.edge(); ++y)
      for (int z = 0; z < voxels.edge(); ++z) {
        const int64_t at[3] = {x + offset[0], y + offset[1], z + offset[2]};
        if (voxels.at(x, y, z) && is_inside(at[0]) && is_inside(at[1]) && is_inside(at[2]))
          moved.set(static_cast<int>(at[0]), static_cast<int>(at[1]), static_cast<int>(at[2]));
      }
  return moved;
}

class CombineMoved : public Combine {
 protected:
  // Writes a file with voxels of edge 0.5. `low` is added to the x of the grid's origin.
  void write(const std::string& name, const oracle::Voxels& voxels, double low = 0) {
    Grid grid = grid_of(voxels.edge());
    grid.origin[0] += low;
    grid.edge = 0.5 * voxels.edge();
    write_global(path(name), oracle::build_dag(voxels, 64), grid);
  }
  CombineSpec at(const Offset& offset, Operation operation = Operation::kUnion) const {
    CombineSpec moved = spec(operation, "c");
    moved.offset = offset;
    moved.clip = true;
    return moved;
  }
  void expect_moved(const oracle::Voxels& a, const oracle::Voxels& b, const CombineSpec& moved) {
    SCOPED_TRACE(testing::PrintToString(*moved.offset));
    const oracle::Voxels target = moved_voxels(b, *moved.offset, a.edge());
    write("expected", combined_voxels(moved.operation, a, target));
    const CombineReport report = combine_files("a", "b", moved);
    EXPECT_TRUE(bytes("c") == bytes("expected"));
    EXPECT_EQ(report.clipped, b.count() - target.count());
  }
};

TEST_F(CombineMoved, EqualsTheOracle) {
  const oracle::Voxels a = random_voxels(21, 32);
  write("a", a);
  for (const int edge : {4, 32, 64}) {
    const oracle::Voxels b = random_voxels(22, edge);
    write("b", b, 7);
    for (const Offset& offset : {Offset{0, 0, 0},
                                 {1, 2, 3},
                                 {-5, 7, 0},
                                 {16, 0, -8},
                                 {4, -4, 12},
                                 {-31, 30, 29},
                                 {-32, 0, 0},
                                 {33, 0, 0},
                                 {int64_t{1} << 62, 0, 0}})
      expect_moved(a, b, at(offset));
  }
}

TEST_F(CombineMoved, AllOperations) {
  const oracle::Voxels a = random_voxels(23, 64), b = random_voxels(24, 64);
  write("a", a);
  write("b", b);
  for (const Operation operation : kAllOperations) expect_moved(a, b, at({3, -6, 10}, operation));
}

TEST_F(CombineMoved, LittleMemory) {
  const oracle::Voxels a = random_voxels(25, 64), b = random_voxels(26, 64);
  write("a", a);
  write("b", b);
  CombineSpec little = at({5, 5, -3});
  little.list_bytes = 256;
  expect_moved(a, b, little);
}

// Moving voxels by an offset and then by the opposite offset gives the original file.
TEST_F(CombineMoved, ThereAndBack) {
  oracle::Voxels b(64);
  fill(b, {8, 9, 10}, {30, 31, 40});
  write("empty", oracle::Voxels(64));
  write("b", b);
  combine_files("empty", "b", at({13, 20, 7}));
  const std::string there = bytes("c");
  std::filesystem::rename(path("c"), path("there"));
  combine_files("empty", "there", at({-13, -20, -7}));
  EXPECT_FALSE(there == bytes("b"));
  EXPECT_TRUE(bytes("c") == bytes("b"));
}

TEST_F(CombineMoved, Refusals) {
  oracle::Voxels b(8);
  fill(b, {0, 0, 0}, {8, 8, 8});
  write("a", random_voxels(27, 32));
  write("b", b);
  write_global(path("other"), b);
  const auto message = [&](const std::string& name) {
    const auto file_a = open_global_file(path("a")), file_b = open_global_file(path(name));
    CombineSpec moved = at({30, 0, 0});
    moved.clip = false;
    const Error error =
        error_of([&] { combine(*file_a, *file_b, moved, system_files(), warnings_, never_); });
    EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
    return error.message();
  };
  const std::string text = message("b");
  EXPECT_NE(text.find("some of its voxels would be outside of the grid"), std::string::npos);
  EXPECT_TRUE(text.ends_with(": expected another offset, or --clip to drop them")) << text;
  EXPECT_TRUE(message("other").starts_with("only files with equal voxels can be combined"));
  expect_files({"a", "b", "other"});
}

}  // namespace
}  // namespace voxdag::query
