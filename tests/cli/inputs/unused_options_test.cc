// Options without effect. If other options make an option useless, the command refuses it. If the
// contents of the input make it useless, the command warns.
#include <gmock/gmock.h>

#include "tests/cli/command_line.h"

namespace command_line {
namespace {

using Arguments = std::vector<std::string>;

class UnusedOptions : public CommandLine {
 protected:
  void SetUp() override {
    make_scene();
    ASSERT_EQ(run({"build", "m.glb", "-r", "64", "-o", "m.vdag"}).status, 0);
  }
  Arguments joined(Arguments first, const Arguments& more) {
    first.insert(first.end(), more.begin(), more.end());
    return first;
  }
};

TEST_F(UnusedOptions, AreRefusedIfTheyNeedAnotherOption) {
  const Arguments build = {"build", "m.glb", "-r", "64", "-o", "x.vdag"},
                  edit = {"edit", "m.vdag", "--cut", "box:0,0,0,1,1,1", "-o", "x.vdag"},
                  combine = {"combine", "m.vdag", "--union", "m.vdag", "-o", "x.vdag"},
                  depth = {"render", "m.vdag", "--depth", "x.npy"}, verify = {"verify", "m.vdag"},
                  page = {"publish", "m.vdag", "--single-file", "-o", "x.html"},
                  check = {"publish", "--check", "p"};
  struct Case {
    Arguments command, option;
    std::string part;
  };
  const Case cases[] = {
      {build, {"--radius", "2"}, "'solid' to be enclosed"},
      {build, {"--seed", "1,1,1"}, "'solid' to be enclosed"},
      {build, {"--color-resolution", "16"}, "color or attributes"},
      {edit, {"--clip"}, "expected --paste"},
      {edit, {"--outside-set"}, "expected --erode"},
      {edit, {"--no-attributes", "--fill-color", "ff0000"}, "--fill-color and --no-attributes"},
      {edit,
       {"--no-attributes", "--color-resolution", "16"},
       "--color-resolution and --no-attributes"},
      {combine, {"--clip"}, "expected --offset"},
      {combine, {"--no-attributes", "--fill-color", "ff0000"}, "--fill-color and --no-attributes"},
      {combine,
       {"--no-attributes", "--color-resolution", "16"},
       "--color-resolution and --no-attributes"},
      {{"extract", "m.vdag", "-o", "x.vdag"}, {"--world"}, "--region"},
      {{"export", "m.vdag", "--to", "npz", "-o", "x.npz"}, {"--levels", "2"}, "--chunks"},
      {{"info", "m.vdag"}, {"--connectivity", "6"}, "--components"},
      {{"info", "m.vdag"}, {"--levels"}, "--csv"},
      {depth, {"--samples", "2"}, "--output"},
      {depth, {"--background", "white"}, "--output"},
      {depth, {"--shade", "normal"}, "--output"},
      {depth, {"--gray"}, "--output"},
      {verify, {"--seed", "2"}, "--against"},
      {verify, {"--skip-invalid"}, "--against"},
      {verify, {"--cutouts", "keep"}, "--against"},
      {verify, {"--solid", "parity"}, "--against"},
      {verify, {"--thin"}, "--against"},
      {verify, {"--point-radius", "1"}, "--against"},
      {verify, {"--columns", "x,y,z"}, "--against"},
      {verify, {"--ignore-extension", "A"}, "--against"},
#ifdef VOXDAG_HAS_VIEWER
      {page, {"--pack-size", "1MiB"}, "--single-file"},
      {check, {"--title", "a"}, "--check"},
      {check, {"--url", "https://a.b/"}, "--check"},
      {check, {"--no-poster"}, "--check"},
      {check, {"--gray"}, "--check"},
      {check, {"--pack-size", "1MiB"}, "--check"},
      {check, {"--single-file"}, "--check"},
#endif
  };
  for (const auto& [command, option, part] : cases) {
    SCOPED_TRACE(command[0] + " " + option.back());
    expect_error(2, part, joined(command, option));
  }
  EXPECT_FALSE(exists("x.vdag"));
}

TEST_F(UnusedOptions, CauseAWarningIfTheInputDoesNotNeedThem) {
  const auto warnings_of = [&](const Arguments& args) {
    const Answer answer = run(joined(args, {"-q", "--force"}));
    EXPECT_EQ(answer.status, 0) << answer.err;
    return answer.err;
  };
  const Arguments edit = {"edit", "m.vdag", "--cut", "box:0,0,0,1,1,1", "-o", "x.vdag"},
                  combine = {"combine", "m.vdag", "--union", "m.vdag", "-o", "x.vdag"},
                  extract = {"extract", "m.vdag", "-o", "x.vdag"};
  const std::pair<Arguments, std::string> cases[] = {
      {joined(edit, {"--color-resolution", "16"}), "--color-resolution has no effect"},
      {joined(combine, {"--color-resolution", "16"}), "--color-resolution has no effect"},
      {joined(combine, {"--fill-color", "ff0000"}), "--fill-color has no effect"},
      {joined(extract, {"--crop"}), "--crop has no effect: the region is the complete grid"},
      {joined(extract, {"--majority"}), "--majority has no effect"},
      {joined(extract, {"--majority", "--level", "6"}), "--majority has no effect"},
  };
  for (const auto& [args, part] : cases)
    EXPECT_THAT(warnings_of(args), testing::HasSubstr("voxdag: warning: " + part)) << args.back();
  for (const Arguments& args : {joined(extract, {"--majority", "--level", "5"}),
                                joined(extract, {"--crop", "--region", "0,0,0,8,8,8"})})
    EXPECT_EQ(warnings_of(args), "");

  const Arguments build = {"build", "m.glb", "-r", "64", "-o", "m.vdag"};
  const std::pair<Arguments, std::string> of_scene[] = {
      {{"--point-radius", "1"},
       "--point-radius has no effect: no file of the scene is a file of points"},
      {{"--columns", "x,y,z"},
       "--columns has no effect: no file of the scene is a text file with points"},
      {{"--ignore-extension", "ACME_bent"}, "--ignore-extension ACME_bent has no effect"},
  };
  for (const auto& [option, part] : of_scene) {
    const Arguments args = joined(build, option);
    EXPECT_THAT(warnings_of(args), testing::HasSubstr("voxdag: warning: " + part));
    EXPECT_EQ(run_json(args)["warnings"][0]["code"], "unused-option");
    EXPECT_EQ(run(joined(args, {"--strict"})).status, 2);
    EXPECT_THAT(run(joined({"verify", "m.vdag", "--against", "m.glb"}, option)).err,
                testing::HasSubstr("voxdag: warning: " + part));
  }
}

// The first union has no colors, but the second has.
TEST_F(UnusedOptions, CauseNoWarningIfALaterEditNeedsThem) {
  ASSERT_EQ(run({"build", "m.glb", "-r", "64", "--color", "-o", "c.vdag"}).status, 0);
  const Answer edited =
      run({"edit", "m.vdag", "--paste", "m.vdag@0,0,0", "--paste", "c.vdag@0,0,0", "--fill-color",
           "ff0000", "--color-resolution", "16", "-q", "-o", "x.vdag"});
  EXPECT_EQ(edited.status, 0);
  EXPECT_EQ(edited.err, "");
  EXPECT_EQ(run_json({"info", "x.vdag"})["colors"]["resolution"], 16);
}

}  // namespace
}  // namespace command_line
