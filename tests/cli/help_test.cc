// Tests of --help, --version and mistyped commands.
#include "tests/cli/command_line.h"

namespace command_line {
namespace {

using Help = CommandLine;

constexpr const char* kCommands[] = {
    "build",  "plan", "status", "info",   "verify",  "diff",   "generate", "render", "extract",
    "submit", "jobs", "watch",  "cancel", "suspend", "resume", "download", "view"};

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
