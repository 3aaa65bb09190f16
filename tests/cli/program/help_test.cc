// Tests of --help, --version and mistyped commands.
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>

#include "scheduler/spec/build_fields.h"
#include "tests/cli/command_line.h"

namespace command_line {
namespace {

using Help = CommandLine;

constexpr const char* kCommands[] = {
    "build",   "plan",    "status", "info",    "verify",  "diff",    "generate", "render",
    "extract", "submit",  "jobs",   "watch",   "cancel",  "suspend", "resume",   "download",
    "view",    "combine", "edit",   "publish", "reorder", "exports",
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

// `voxdag COMMAND --help` succeeds for every command, without the command's required arguments. The
// help text mentions --json.
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

// If the reader of the standard output has closed the pipe, as `head` does, commands end by SIGPIPE
// and print no error. The output of `build --help` is longer than the buffer of the standard
// output, the output of `version` is shorter.
TEST_F(Help, EndsQuietlyIfItsReaderHasLeft) {
  for (const std::vector<std::string>& args : {std::vector<std::string>{"build", "--help"},
                                               {"version"},
                                               {"help", "jobs"},
                                               {"version", "--json"}}) {
    int ends[2];
    ASSERT_EQ(pipe(ends), 0);
    close(ends[0]);
    const Answer answer = wait_for(start(args, ends[1]));
    close(ends[1]);
    EXPECT_EQ(answer.status, 128 + SIGPIPE) << args[0];
    EXPECT_EQ(answer.err, "") << args[0];
  }
}

// A full disk is an error.
TEST_F(Help, ReportsThatItCannotBeWritten) {
  const int full = open("/dev/full", O_WRONLY);
  ASSERT_GE(full, 0);
  const Answer answer = wait_for(start({"version"}, full));
  close(full);
  EXPECT_EQ(answer.status, 7) << answer.err;
  EXPECT_NE(answer.err.find("write to the standard output: "), std::string::npos) << answer.err;
}

// Checks for each field that the help text has its option if and only if the field's scope is at
// most `scope` (kSubmit, kPlan or kBuild).
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
  for (const char* word : {"-V", "version"}) EXPECT_EQ(run({word}).out, answer.out) << word;
}

// The version lists every optional feature, whether this program has it or not, with the packages
// that the feature needs.
TEST_F(Help, VersionListsTheFeatures) {
  const std::string text = run({"--version", "--verbose"}).out;
  const Json json = run_json({"version"});
  EXPECT_EQ(json["version"].get<std::string>() + "\n", run({"version"}).out);
  for (const char* name : {"commit", "compiler", "build_type"})
    EXPECT_FALSE(json[name].get<std::string>().empty()) << name;
  std::vector<std::string> names;
  for (const Json& feature : json["features"]) {
    names.push_back(feature["name"]);
    EXPECT_NE(text.find("\n  " + names.back()), std::string::npos) << names.back();
    EXPECT_FALSE(feature["packages"].get<std::string>().empty()) << names.back();
  }
  for (const char* name : {"cuda", "vdb", "draco", "meshopt", "webp", "avif", "assimp"})
    EXPECT_NE(std::find(names.begin(), names.end(), name), names.end()) << name;
}

TEST_F(Help, HelpOfACommandByItsName) {
  EXPECT_EQ(run({"help"}).out, run({"--help"}).out);
  EXPECT_EQ(run({"help", "build"}).out, run({"build", "--help"}).out);
  expect_error(2, "did you mean build?", {"help", "biuld"});
}

// A missing or unknown command or option is invalid input, reported on standard error.
TEST_F(Help, MistypedCommandsAreInvalidInput) {
  expect_error(2, "voxdag --help", {});
  expect_error(2, "unknown command 'biuld': expected one of build, ", {"biuld"});
  expect_error(2, "; did you mean build?", {"biuld"});
  expect_error(2, "expected one of build, ", {"scene.glb"});
  expect_error(2, "info: unknown option '--frobnicate'", {"info", "x.vdag", "--frobnicate"});
  expect_error(2, "; did you mean --digest?", {"info", "x.vdag", "--digets"});
  expect_error(2, "; did you mean --color?", {"build", "x.glb", "-r", "64", "--colur"});
  expect_error(2, "; did you mean --output?", {"build", "x.glb", "-r", "64", "--outptu=x.vdag"});
  expect_error(2, "; did you mean --force?", {"export", "x.vdag", "--for"});
  expect_error(2, "verify: unexpected argument 'y.vdag'", {"verify", "x.vdag", "y.vdag"});
  expect_error(2, "--resolution", {"build", "x.glb", "-o", "x.vdag"});
  expect_error(2, "--output", {"build", "x.glb", "-r", "64"});
  for (const char* command : kCommands) {
    SCOPED_TRACE(command);
    expect_error(2, "required", {command});
  }
}

}  // namespace
}  // namespace command_line
