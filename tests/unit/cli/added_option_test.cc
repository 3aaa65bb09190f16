// Adds an option to the fields of a struct (core/fields). It then appears on the command line, in
// JSON, in the schema and among the Python keywords, without any other change.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "cli/option_fields.h"
#include "core/fields/json_fields.h"
#include "core/fields/json_schema.h"
#include "python/generate/keyword_writer.h"
#include "scheduler/spec/build_fields.h"

namespace voxdag {

struct MoreOptions {
  BuildSpec spec;
  uint32_t smoothness = 3;
};

template <class Visitor>
void fields(Visitor& visit, MoreOptions& options) {
  fields(visit, options.spec);
  visit(Field("edge_smoothness", "rounds of smoothing").range(0, 9), options.smoothness);
}

namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;

struct AddedOption {
  MoreOptions options;
};

void declare(cli::Command& command, AddedOption& state) {
  cli::OptionDeclarer declarer(command, Scope::kBuild);
  fields(declarer, state.options);
}

void run(const AddedOption& state, cli::CommandContext& context) {
  context.exit_status = static_cast<int>(state.options.smoothness);
}

// Runs a command with these arguments, and returns its exit status.
int run_command(std::vector<std::string> arguments) {
  CancelToken cancel;
  cli::CommandContext context{system_files(), cancel};
  cli::CommandLine line(context);
  cli::add_command<AddedOption>(line, "build", "builds");
  std::vector<char*> words;
  for (std::string& argument : arguments) words.push_back(argument.data());
  return line.run(static_cast<int>(words.size()), words.data());
}

TEST(AddedOption, IsOnTheCommandLine) {
  testing::internal::CaptureStdout();
  EXPECT_EQ(run_command({"voxdag", "build", "--help"}), 0);
  const std::string help = testing::internal::GetCapturedStdout();
  EXPECT_THAT(help, HasSubstr("--edge-smoothness N"));
  EXPECT_THAT(help, HasSubstr("rounds of smoothing"));
  EXPECT_THAT(help, HasSubstr("(default: 3)"));
  const std::vector<std::string> build = {"voxdag", "build", "a.glb", "-r", "64", "-o", "a.vdag"};
  auto with = [&](const std::string& value) {
    auto arguments = build;
    arguments.insert(arguments.end(), {"--edge-smoothness", value});
    return arguments;
  };
  EXPECT_EQ(run_command(build), 3);
  EXPECT_EQ(run_command(with("7")), 7);
  EXPECT_EQ(run_command({"voxdag", "build", "-r", "64", "-o", "a.vdag", "--ignore-extension", "A",
                         "--ignore-extension", "B", "a.glb"}),
            3)
      << "an option for a list takes one value";
  try {
    run_command(with("10"));
    ADD_FAILURE() << "was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.message(), "--edge-smoothness: '10': expected a whole number from 0 to 9");
  }
}

TEST(AddedOption, IsInJsonAndItsSchema) {
  MoreOptions options;
  options.smoothness = 5;
  EXPECT_EQ(options_json(options).dump(), R"({"edge_smoothness":5})");
  MoreOptions back;
  set_options(
      FieldJson::parse(R"({"scene":["a"],"resolution":4,"output":"b","edge_smoothness":9})"),
      "the body", back);
  EXPECT_EQ(back.smoothness, 9u);
  EXPECT_EQ(options_schema<MoreOptions>()["properties"]["edge_smoothness"].dump(),
            R"j({"type":"integer","minimum":0,"maximum":9,)j"
            R"j("description":"rounds of smoothing (default: 3)"})j");
}

TEST(AddedOption, IsAPythonKeyword) {
  python::KeywordWriter writer;
  MoreOptions options;
  fields(writer, options);
  EXPECT_THAT(writer.members, HasSubstr("    edge_smoothness: Optional[int]\n"));
  EXPECT_THAT(writer.documents, HasSubstr("rounds of smoothing: a whole number from 0 to 9"));
  EXPECT_THAT(writer.members, HasSubstr("    memory: Optional[Union[int, str]]\n"));
  EXPECT_THAT(writer.members, HasSubstr("    color: Optional[bool]\n"));
  EXPECT_THAT(writer.members,
              HasSubstr("    ignore_extension: Optional[Union[str, Sequence[str]]]\n"));
  EXPECT_THAT(writer.members, HasSubstr("    backend: Optional[Literal[\"auto\", \"cpu\""));
}

// Expects that the public C++ header has a member for each option. The member's name can have a
// unit or a kind at its end, as in cache_bytes.
struct MemberFinder {
  template <class T>
  void operator()(const Field& field, T&) {
    const std::map<std::string, std::string> others = {
        {"scene", "scenes"}, {"cache_size", "cache_bytes"}, {"attributes", "material"}};
    const auto other = others.find(field.name);
    const std::string member = other == others.end() ? field.name : other->second;
    EXPECT_THAT(header, ContainsRegex(" " + member + "(_bytes|_edge|_folder)?( =|;)"));
  }

  std::string header;
};

TEST(PublicBuildOptions, HaveTheOptionsOfTheDescription) {
  MemberFinder finder{
      read_small_file(system_files(), VOXDAG_SOURCE_DIR "/include/voxdag/build.h", 1 << 20)};
  BuildSpec spec;
  fields(finder, spec);
}

}  // namespace
}  // namespace voxdag
