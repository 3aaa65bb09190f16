// Tests of --help, --version and mistyped commands.
#include "scheduler/spec/build_fields.h"
#include "tests/cli/command_line.h"

namespace command_line {
namespace {

using Help = CommandLine;

constexpr const char* kCommands[] = {
    "build",  "plan", "status", "info",   "verify",  "diff",   "generate", "render", "extract",
    "submit", "jobs", "watch",  "cancel", "suspend", "resume", "download", "view",   "combine",
#ifdef VOXDAG_HAS_ASSIMP
    "import",
#endif
};

TEST_F(Help, ListsAllCommands) {
  const Answer answer = run({"--help"});
  EXPECT_EQ(answer.status, 0);
  for (const char* command : kCommands)
    EXPECT_NE(answer.out.find(std::string("\n  ") + command + " "), std::string::npos) << command;
}

// Every command has --help, which mentions --json, and works without any other option.
TEST_F(Help, OfEveryCommand) {
  for (const char* command : kCommands) {
    SCOPED_TRACE(command);
    const Answer answer = run({command, "--help"});
    EXPECT_EQ(answer.status, 0);
    EXPECT_EQ(answer.err, "");
    EXPECT_NE(answer.out.find(std::string("Usage: voxdag ") + command), std::string::npos);
    EXPECT_NE(answer.out.find("--json"), std::string::npos);
  }
}

// Checks that a help text has the options of the commands up to `scope`, and no others.
struct OptionFinder {
  template <class T>
  void operator()(const voxdag::Field& field, T&) {
    if (field.is_positional) return;
    ++count;
    EXPECT_EQ(help.find(voxdag::option_name(field.name)) != std::string::npos, field.scope <= scope)
        << field.name;
  }

  std::string help;
  voxdag::Scope scope;
  int count = 0;
};

TEST_F(Help, HasTheOptionsOfTheDescription) {
  const std::pair<const char*, voxdag::Scope> commands[] = {{"submit", voxdag::Scope::kSubmit},
                                                            {"plan", voxdag::Scope::kPlan},
                                                            {"build", voxdag::Scope::kBuild}};
  for (const auto& [command, scope] : commands) {
    SCOPED_TRACE(command);
    OptionFinder finder{run({command, "--help"}).out, scope};
    voxdag::BuildSpec spec;
    fields(finder, spec);
    EXPECT_GE(finder.count, 19);
    voxdag::ClusterOptions cluster;
    if (scope != voxdag::Scope::kSubmit) fields(finder, cluster);
  }
}

TEST_F(Help, AndDocsHaveTheSameOptions) {
  OptionFinder finder{
      voxdag::read_small_file(voxdag::system_files(), VOXDAG_SOURCE_DIR "/docs/cli.md", 1 << 20),
      voxdag::Scope::kBuild};
  voxdag::BuildSpec spec;
  fields(finder, spec);
  voxdag::ClusterOptions cluster;
  fields(finder, cluster);
}

TEST_F(Help, Version) {
  const Answer answer = run({"--version"});
  EXPECT_EQ(answer.status, 0);
  EXPECT_EQ(answer.out.find_first_of("0123456789"), answer.out.find_first_not_of("voxdag "));
}

// A missing or unknown command or option is invalid input, reported on standard error.
TEST_F(Help, MistypedCommandsAreInvalidInput) {
  expect_error(2, "subcommand", {});
  expect_error(2, "", {"biuld"});
  expect_error(2, "--frobnicate", {"info", "x.vdag", "--frobnicate"});
  expect_error(2, "--resolution", {"build", "x.glb", "-o", "x.vdag"});
  expect_error(2, "--output", {"build", "x.glb", "-r", "64"});
  for (const char* command : kCommands) {
    SCOPED_TRACE(command);
    expect_error(2, "required", {command});
  }
}

}  // namespace
}  // namespace command_line
