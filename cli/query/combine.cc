#include "query/combine/combine.h"

#include <array>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>

#include "cli/output.h"
#include "cli/query/attribute_options.h"
#include "cli/query/combine_report.h"
#include "cli/run_times.h"
#include "cli/selection_options.h"
#include "cli/terminal/progress_bar.h"
#include "core/format/global/open_global.h"

namespace voxdag::cli {
namespace {

// An option that selects an operation and names the second file of the operation.
struct OperationOption {
  const char* name;
  query::Operation operation;
  const char* help;
};
constexpr OperationOption kOperationOptions[] = {
    {"--union", query::Operation::kUnion, "the voxels of either file"},
    {"--minus", query::Operation::kMinus, "the voxels that only the first file has"},
    {"--and", query::Operation::kAnd, "the voxels that both files have"},
    {"--xor", query::Operation::kXor, "the voxels that exactly one of the files has"},
};

struct CombineCommand {
  std::string a, output, memory;
  std::string b[std::size(kOperationOptions)];  // the second file, at the index of its operation
  std::optional<std::array<int64_t, 3>> offset;
  AttributeOptions attributes;
  bool clip = false, force = false, quiet = false, json = false;
  unsigned threads = default_threads();
};

// Returns the index in kOperationOptions of the operation that the user gave. Throws Error unless
// the user gave exactly one.
size_t operation_of(const CombineCommand& command) {
  size_t found = 0, given = 0;
  for (size_t i = 0; i < std::size(kOperationOptions); ++i) {
    if (command.b[i].empty()) continue;
    found = i;
    ++given;
  }
  if (given != 1)
    throw Error(ErrorCode::kInvalidInput,
                "no operation or several operations are given: expected one of --union, --minus, "
                "--and and --xor");
  return found;
}

void run(const CombineCommand& command, CommandContext& context) {
  const size_t operation = operation_of(command);
  query::CombineSpec spec;
  spec.operation = kOperationOptions[operation].operation;
  spec.output = command.output;
  spec.offset = command.offset;
  spec.clip = command.clip;
  command.attributes.apply(spec);
  spec.replace = command.force;
  spec.memory_bytes = memory_limit(command.memory);
  spec.threads = command.threads;
  const auto a = open_global_file(command.a), b = open_global_file(command.b[operation]);
  const auto progress = make_progress_bar(command.quiet);
  const RunTimer timer;
  const query::CombineReport report =
      query::combine(*a, *b, spec, context.files, *progress, context.cancel);
  const RunTimes times = timer.elapsed();
  if (command.quiet && !command.json) return;
  if (!command.json) return print_combined(command.output, report, times);
  print_json(combined_json(command.output, report, times));
}

void declare(Command& command, CombineCommand& state) {
  command.option("input", state.a, "the first .vdag file").required();
  for (size_t i = 0; i < std::size(kOperationOptions); ++i)
    command.option(kOperationOptions[i].name, state.b[i], kOperationOptions[i].help)
        .group("Operation and second .vdag file, one of");
  command.text_option(
      "--offset", "X,Y,Z",
      [&state](const std::string& text) {
        state.offset = parse_list<int64_t, 3>("--offset", text, ',', "three whole numbers X,Y,Z");
      },
      "move the second file: its voxel 0,0,0 comes to this voxel of the first file's grid");
  command.flag("--clip", state.clip,
               "drop voxels that --offset moves out of the grid; otherwise they are an error");
  state.attributes.declare(command);
  command.output_option("-o,--output", state.output, "the .vdag file to write").required();
  command.memory_option(state.memory);
  command.threads_option(state.threads);
  command.flag("--force", state.force, "replace an existing file");
  command.quiet_flag(state.quiet);
  command.json_flag(state.json);
}

}  // namespace

void add_combine_command(CommandLine& line) {
  add_command<CombineCommand>(line, "combine", "union, difference or intersection of two DAGs");
}

}  // namespace voxdag::cli
