#include "query/combine/combine.h"

#include <cstdio>
#include <iterator>
#include <nlohmann/json.hpp>

#include "cli/output.h"
#include "cli/run_times.h"
#include "cli/selection_options.h"
#include "cli/terminal/progress_bar.h"
#include "core/base/process_limits.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "core/format/global/open_global.h"

namespace voxdag::cli {
namespace {

// The options that name the second file, one for each operation.
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
  std::string b[std::size(kOperationOptions)];  // given for one of the operations
  bool force = false, quiet = false, json = false;
  unsigned threads = default_threads();
};

// Returns the index of the operation in kOperationOptions.
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

void print(const CombineCommand& command, const query::CombineReport& r, const RunTimes& times) {
  std::printf("%s: %s, sha256 %s\n", printable_line(command.output).c_str(),
              size_text(r.bytes).c_str(), r.sha256.c_str());
  std::printf("  %s voxels, %s octree nodes, %s DAG nodes\n", count_text(r.voxels).c_str(),
              count_text(r.svo_nodes).c_str(), count_text(r.dag_nodes).c_str());
  std::printf("  %s pairs of nodes, %s wall, %s CPU, peak memory %s\n", count_text(r.pairs).c_str(),
              duration_text(times.wall_s).c_str(), duration_text(times.cpu_s).c_str(),
              size_text(peak_resident_bytes()).c_str());
}

nlohmann::ordered_json combine_json(const CombineCommand& command, const query::CombineReport& r,
                                    const RunTimes& times) {
  return {{"output", command.output},
          {"sha256", r.sha256},
          {"resolution", r.grid.resolution()},
          {"bounds", {{"origin", r.grid.origin}, {"edge", r.grid.edge}}},
          {"voxels", r.voxels},
          {"svo_nodes", r.svo_nodes},
          {"dag_nodes", r.dag_nodes},
          {"bytes", r.bytes},
          {"pairs", r.pairs},
          {"work_bytes", r.work_bytes},
          {"wall_s", times.wall_s},
          {"cpu_s", times.cpu_s},
          {"peak_rss_bytes", peak_resident_bytes()}};
}

void run(const CombineCommand& command, CommandContext& context) {
  const size_t operation = operation_of(command);
  query::CombineSpec spec;
  spec.operation = kOperationOptions[operation].operation;
  spec.output = command.output;
  spec.replace = command.force;
  spec.memory_bytes = memory_limit(command.memory);
  spec.threads = command.threads;
  const auto a = open_global_file(command.a), b = open_global_file(command.b[operation]);
  const auto progress = make_progress_bar(command.quiet);
  const RunTimer timer;
  const query::CombineReport report =
      query::combine(*a, *b, spec, context.files, *progress, context.cancel);
  const RunTimes times = timer.elapsed();
  if (!command.json) return print(command, report, times);
  print_json(combine_json(command, report, times));
}

void declare(Command& command, CombineCommand& state) {
  command.option("input", state.a, "the first .vdag file").required();
  for (size_t i = 0; i < std::size(kOperationOptions); ++i)
    command.option(kOperationOptions[i].name, state.b[i], kOperationOptions[i].help)
        .group("Operation and second .vdag file, one of");
  command.output_option("-o,--output", state.output, "the .vdag file to write").required();
  command.option("--memory", state.memory,
                 "memory to use, such as 512MiB (default: half of the machine's; at least 64MiB)");
  command.threads_option(state.threads);
  command.flag("--force", state.force, "replace an existing file");
  command.quiet_flag(state.quiet);
  command.json_flag(state.json);
}

}  // namespace

void add_combine_command(CommandLine& line) {
  add_command<CombineCommand>(line, "combine",
                              "union, difference or intersection of two DAGs of the same grid");
}

}  // namespace voxdag::cli
