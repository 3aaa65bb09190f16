// A file from which a shape is cut has the bytes of the file that the oracle makes from the
// remaining voxels.
#include "query/combine/shape.h"
#include "tests/unit/query/combine/combine_fixture.h"

namespace voxdag::query {
namespace {

class CombineCut : public Combine {
 protected:
  // Cuts `shape` from a file of the voxels `a`, and compares the result with the oracle's.
  // is_inside(x, y, z) tells whether the shape contains this point, the center of a voxel.
  template <class IsInside>
  void expect_cut(const oracle::Voxels& a, const std::string& shape, const IsInside& is_inside) {
    SCOPED_TRACE(shape);
    oracle::Voxels expected(a.edge());
    for (int x = 0; x < a.edge(); ++x)
      for (int y = 0; y < a.edge(); ++y)
        for (int z = 0; z < a.edge(); ++z)
          if (a.at(x, y, z) && !is_inside(x + 0.5, y + 0.5, z + 0.5)) expected.set(x, y, z);
    write_global(path("a"), a);
    write_global(path("expected"), expected);
    const auto file = open_global_file(path("a"));
    const CombineReport report =
        cut(*file, Shape(shape), spec(Operation::kUnion, "c"), system_files(), warnings_, never_);
    EXPECT_TRUE(bytes("c") == bytes("expected"));
    EXPECT_EQ(report.voxels, expected.count());
  }
  void expect_sphere(const oracle::Voxels& a, double x, double y, double z, double radius) {
    std::ostringstream text;
    text << "sphere:" << x << "," << y << "," << z << "," << radius;
    expect_cut(a, text.str(), [&](double px, double py, double pz) {
      return (px - x) * (px - x) + (py - y) * (py - y) + (pz - z) * (pz - z) <= radius * radius;
    });
  }
};

TEST_F(CombineCut, Spheres) {
  oracle::Voxels full(32);
  fill(full, {0, 0, 0}, {32, 32, 32});
  for (const oracle::Voxels& a : {full, random_voxels(31, 32)}) {
    expect_sphere(a, 16, 16, 16, 11);
    expect_sphere(a, 10.5, 16, 7.5, 6.5);
    expect_sphere(a, 10.5, 3.5, 7.5, 0);
    expect_sphere(a, 10, 3, 7, 0.5);
    expect_sphere(a, -20, 40, 10, 30);
    expect_sphere(a, 16, 16, 16, 28);
    expect_sphere(a, 500, 16, 16, 100);
  }
}

TEST_F(CombineCut, Boxes) {
  oracle::Voxels full(32);
  fill(full, {0, 0, 0}, {32, 32, 32});
  for (const oracle::Voxels& a : {full, random_voxels(32, 32)}) {
    expect_cut(a, "box:3,-5,8,21,17,9", [](double x, double y, double z) {
      return x > 3 && x < 21 && y < 17 && z > 8 && z < 9;
    });
    expect_cut(a, "box:8,0,16,16,100,32",
               [](double x, double, double z) { return x > 8 && x < 16 && z > 16; });
    expect_cut(a, "box:-1,-1,-1,32,32,32", [](double, double, double) { return true; });
  }
}

TEST_F(CombineCut, NothingOfAnEmptyFile) { expect_sphere(oracle::Voxels(16), 8, 8, 8, 5); }

TEST_F(CombineCut, Refusals) {
  for (const char* text :
       {"", "sphere", "sphere:1,2,3", "sphere:1,2,3,-1", "sphere:1,2,3,0.25", "sphere:1,2,3,nan",
        "sphere:1e30,2,3,4", "box:1,2,3,4,5", "box:0,0,0,1,1,0", "box:0,0,0,1.5,1,1", "cone:1"}) {
    const Error error = error_of([&] { Shape shape{text}; });
    EXPECT_EQ(error.code(), ErrorCode::kInvalidInput);
    EXPECT_TRUE(error.message().starts_with("shape '")) << error.message();
  }
}

}  // namespace
}  // namespace voxdag::query
