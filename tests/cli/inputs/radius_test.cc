// Tests build and verify with --solid enclosed --radius on a box with a gap in its lid.
#include "tests/cli/command_line.h"

namespace command_line {
namespace {

class RadiusOption : public CommandLine {
 protected:
  // Writes a box from 4 to 28 along all axes. At the resolution 32, the gap in its lid is 2 voxels
  // wide.
  void SetUp() override {
    std::string text;
    for (const char* y : {"4", "28"})
      for (const char* x : {"4", "28", "14.5", "17.5"})
        for (const char* z : {"4", "28"}) text += std::string("v ") + x + " " + y + " " + z + "\n";
    // The number of a vertex is 8 * (y is 28) + 2 * (index of x in the list) + (z is 28) + 1.
    text += "f 1 3 4 2\nf 9 11 12 10\nf 1 9 10 2\nf 3 11 12 4\nf 1 3 11 9\n";  // all but the lid
    text += "f 2 6 14 10\nf 8 4 12 16\n";  // the lid, with a gap at 14.5 < x < 17.5
    put("box.obj", text);
  }
  std::vector<std::string> build(const std::string& radius) const {
    return {"build", "box.obj", "-r",      "32",       "--bounds", "0,0,0,32",
            "-o",    "b.vdag",  "--solid", "enclosed", "--radius", radius};
  }
};

TEST_F(RadiusOption, SealsGaps) {
  const Json open = run_json(build("1"));
  EXPECT_EQ(open["solid"]["interior"], 0);
  EXPECT_EQ(open["solid"]["radius"], 1);
  EXPECT_EQ(open["warnings"][0]["code"], "solid-reached");
  const Json sealed = run_json(build("2"));
  EXPECT_GE(sealed["solid"]["interior"], 22 * 22 * 22);
  EXPECT_EQ(sealed["solid"]["radius"], 2);
  for (const char* seed : {"1", "2", "3", "4"}) {
    const Json checked = run_json({"verify", "b.vdag", "--against", "box.obj", "--solid",
                                   "enclosed", "--radius", "2", "--seed", seed});
    EXPECT_EQ(checked["ok"], true);
    EXPECT_GT(checked["against"]["interior"]["inside"], 0);
  }
  const Json plan = run_json({"plan", "box.obj", "-r", "32", "--bounds", "0,0,0,32", "--solid",
                              "enclosed", "--radius", "2"});
  EXPECT_EQ(plan["solid"]["interior"]["likely"], sealed["solid"]["interior"]);
}

// verify without --radius rejects a solid that was built with a radius: the voxels that fill the
// gap are set, but no triangle touches them.
TEST_F(RadiusOption, VerifyFindsAnotherRadius) {
  run_json(build("2"));
  bool is_found = false;
  for (int seed = 1; seed <= 20 && !is_found; ++seed)
    is_found = run({"verify", "b.vdag", "--against", "box.obj", "--solid", "enclosed", "--seed",
                    std::to_string(seed)})
                   .status == 4;
  EXPECT_TRUE(is_found);
}

// With --seed, the cube of V + 1 voxels per edge (docs/solid.md) starts around the seed. So the
// build fails if the cube does not fit into the empty space there.
TEST_F(RadiusOption, StartsAtTheSeed) {
  const auto seeded = [&](const char* radius, const char* seed) {
    auto arguments = build(radius);
    arguments.insert(arguments.end(), {"--seed", seed});
    return arguments;
  };
  const Json sealed = run_json(seeded("2", "16,16,16"));
  EXPECT_GE(sealed["solid"]["interior"], 22 * 22 * 22);
  EXPECT_EQ(sealed["solid"]["radius"], 2);
  EXPECT_EQ(sealed["solid"]["seed"][2], 16);
  EXPECT_EQ(run_json({"verify", "b.vdag", "--against", "box.obj", "--solid", "enclosed", "--radius",
                      "2"})["ok"],
            true);
  const Json plan = run_json({"plan", "box.obj", "-r", "32", "--bounds", "0,0,0,32", "--solid",
                              "enclosed", "--radius", "2", "--seed", "16,16,16"});
  EXPECT_EQ(plan["solid"]["interior"]["likely"], sealed["solid"]["interior"]);
  EXPECT_EQ(run_json(seeded("1", "16,16,16"))["warnings"][0]["code"], "solid-reached");
  expect_error(2, "farther from surfaces", seeded("2", "8,16,27.5"));
}

TEST_F(RadiusOption, RefusedValues) {
  expect_error(2, "16", build("17"));
  expect_error(2, "radius", {"build", "box.obj", "-r", "32", "-o", "b.vdag", "--radius", "1"});
  run_json(build("2"));
  expect_error(
      2, "16",
      {"verify", "b.vdag", "--against", "box.obj", "--solid", "enclosed", "--radius", "17"});
  expect_error(2, "--thin: expected no --solid at the same time",
               {"verify", "b.vdag", "--against", "box.obj", "--solid", "enclosed", "--thin"});
}

}  // namespace
}  // namespace command_line
