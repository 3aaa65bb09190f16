// Builds the same points from files of each format.
#include <cstring>

#include "tests/cli/command_line.h"

namespace command_line {
namespace {

// The corners of a cube and its center, with integer coordinates.
constexpr int32_t kPoints[][3] = {{0, 0, 0},   {64, 0, 0},  {0, 64, 0},   {64, 64, 0}, {0, 0, 64},
                                  {64, 0, 64}, {0, 64, 64}, {64, 64, 64}, {32, 32, 32}};

std::string rows(const char* separator) {
  std::string text;
  for (const auto& p : kPoints)
    text += std::to_string(p[0]) + separator + std::to_string(p[1]) + separator +
            std::to_string(p[2]) + "\n";
  return text;
}

std::string las() {
  std::string file(227, '\0');
  const auto put = [&](size_t at, auto value) { std::memcpy(&file[at], &value, sizeof(value)); };
  file.replace(0, 4, "LASF");
  put(24, uint16_t{0x0201});  // version 1.2
  put(94, uint16_t{227});
  put(96, uint32_t{227});
  put(105, uint16_t{20});
  put(107, static_cast<uint32_t>(std::size(kPoints)));
  for (const size_t at : {131, 139, 147}) put(at, 1.0);
  for (const auto& p : kPoints) {
    file.append(reinterpret_cast<const char*>(p), sizeof(p));
    file.append(8, '\0');
  }
  return file;
}

class Points : public CommandLine {};

TEST_F(Points, EveryFormatGivesTheSameBytes) {
  put("a.ply",
      "ply\nformat ascii 1.0\nelement vertex 9\nproperty int x\nproperty int y\n"
      "property int z\nend_header\n" +
          rows(" "));
  put("a.xyz", rows(" "));
  put("a.txt", rows("\t"));
  put("a.csv", "x;y;z\n" + rows(";"));
  put("a.las", las());
  const std::string digest = run_json({"build", "a.ply", "-r", "64", "-o", "ply.vdag"})["sha256"];
  for (const std::string name : {"a.xyz", "a.txt", "a.csv", "a.las"}) {
    const Json report = run_json({"build", name, "-r", "64", "-o", name + ".vdag"});
    EXPECT_EQ(report["sha256"], digest) << name;
    EXPECT_EQ(report["voxels"], 9) << name;
    EXPECT_EQ(run_json({"verify", name + ".vdag", "--against", name})["ok"], true) << name;
  }
}

// With --point-radius 5 and voxels of edge 1, a point becomes the surface of a cube with 11 voxels
// along each edge: the point's voxel, and five voxels on each side.
TEST_F(Points, RadiusMakesCubes) {
  put("a.xyz", "1 2 3\n");
  const Json one = run_json({"build", "a.xyz", "-r", "64", "--voxel-size", "1", "-o", "one.vdag"});
  EXPECT_EQ(one["voxels"], 1);
  const Json cube = run_json({"build", "a.xyz", "-r", "64", "--voxel-size", "1", "--point-radius",
                              "5", "-o", "cube.vdag"});
  EXPECT_EQ(cube["voxels"], 11 * 11 * 11 - 9 * 9 * 9);
  EXPECT_EQ(run_json({"verify", "cube.vdag", "--against", "a.xyz", "--point-radius", "5"})["ok"],
            true);
}

TEST_F(Points, ColumnsAreNamed) {
  put("a.txt", "9 0 0 5\n9 8 8 5\n");
  const Json report = run_json(
      {"build", "a.txt", "-r", "64", "--columns", "_,x,y,z", "--voxel-size", "1", "-o", "a.vdag"});
  EXPECT_EQ(report["voxels"], 2);
  expect_error(2, "--columns", {"build", "a.txt", "-r", "64", "--columns", "x,y", "-o", "b.vdag"});
  expect_error(2, "line 1",
               {"build", "a.txt", "-r", "64", "--columns", "_,_,x,y,z", "-o", "b.vdag"});
}

}  // namespace
}  // namespace command_line
