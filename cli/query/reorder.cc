#include "query/reorder/reorder.h"

#include <cstdio>
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

struct ReorderCommand {
  std::string input, output, memory;
  std::string order = name_of(NodeOrder::kByFirstParent);
  bool force = false, quiet = false, json = false;
  unsigned threads = default_threads();
};

void print(const ReorderCommand& command, const query::ReorderReport& r, const RunTimes& times) {
  std::printf("%s: %s, sha256 %s\n", printable_line(command.output).c_str(),
              size_text(r.bytes).c_str(), r.sha256.c_str());
  std::printf("  nodes in the order %s, %s wall, %s CPU, peak memory %s\n", command.order.c_str(),
              duration_text(times.wall_s).c_str(), duration_text(times.cpu_s).c_str(),
              size_text(peak_resident_bytes()).c_str());
}

void run(const ReorderCommand& command, CommandContext& context) {
  query::ReorderSpec spec;
  spec.order =
      command.order == name_of(NodeOrder::kByHash) ? NodeOrder::kByHash : NodeOrder::kByFirstParent;
  spec.output = command.output;
  spec.replace = command.force;
  spec.memory_bytes = memory_limit(command.memory);
  spec.threads = command.threads;
  const auto file = open_global_file(command.input);
  const auto progress = make_progress_bar(command.quiet);
  const RunTimer timer;
  const query::ReorderReport report =
      query::reorder(*file, spec, context.files, *progress, context.cancel);
  const RunTimes times = timer.elapsed();
  if (command.quiet && !command.json) return;
  if (!command.json) return print(command, report, times);
  print_json(nlohmann::ordered_json{{"output", command.output},
                                    {"sha256", report.sha256},
                                    {"node_order", command.order},
                                    {"dag_nodes", file->dag_nodes()},
                                    {"bytes", report.bytes},
                                    {"work_bytes", report.work_bytes},
                                    {"wall_s", times.wall_s},
                                    {"cpu_s", times.cpu_s},
                                    {"peak_rss_bytes", peak_resident_bytes()}});
}

void declare(Command& command, ReorderCommand& state) {
  command.option("input", state.input, "the .vdag file").required();
  command.output_option("-o,--output", state.output, "the .vdag file to write").required();
  command
      .option("--order", state.order,
              "first-parent: for fast reading; hash: for combine and edit, as a build writes it")
      .one_of({name_of(NodeOrder::kByFirstParent), name_of(NodeOrder::kByHash)})
      .show_default();
  command.memory_option(state.memory);
  command.threads_option(state.threads);
  command.flag("--force", state.force, "replace an existing file");
  command.quiet_flag(state.quiet);
  command.json_flag(state.json);
}

}  // namespace

void add_reorder_command(CommandLine& line) {
  add_command<ReorderCommand>(line, "reorder", "write a DAG with its nodes in another order");
}

}  // namespace voxdag::cli
