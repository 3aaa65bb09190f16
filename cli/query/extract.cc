#include "query/extract/extract.h"

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

struct ExtractCommand {
  std::string input, output, memory;
  SelectionOptions selection;
  bool crop = false, majority = false, force = false, quiet = false, json = false;
  unsigned threads = default_threads();
};

void print(const ExtractCommand& command, const query::ExtractReport& r, const RunTimes& times) {
  std::printf("%s: %s, sha256 %s\n", printable_line(command.output).c_str(),
              size_text(r.bytes).c_str(), r.sha256.c_str());
  std::printf("  grid of %lld^3 voxels, low corner %.9g %.9g %.9g, edge %.9g\n",
              static_cast<long long>(r.grid.resolution()), r.grid.origin[0], r.grid.origin[1],
              r.grid.origin[2], r.grid.edge);
  std::printf("  %s voxels, %s octree nodes, %s DAG nodes\n", count_text(r.voxels).c_str(),
              count_text(r.svo_nodes).c_str(), count_text(r.dag_nodes).c_str());
  std::printf("  %s cubes (%s split), %s wall, %s CPU, peak memory %s\n",
              count_text(r.parts).c_str(), count_text(r.parts_split).c_str(),
              duration_text(times.wall_s).c_str(), duration_text(times.cpu_s).c_str(),
              size_text(peak_resident_bytes()).c_str());
}

nlohmann::ordered_json extract_json(const ExtractCommand& command, const query::ExtractReport& r,
                                    const voxdag_reader::File& written, const RunTimes& times) {
  nlohmann::ordered_json levels = nlohmann::ordered_json::array();
  for (uint32_t l = 0; l <= written.brick_level(); ++l)
    levels.push_back({{"level", l},
                      {"nodes", written.level(l).node_count},
                      {"bytes", written.level(l).word_count * sizeof(uint32_t)}});
  nlohmann::ordered_json json{{"output", command.output},
                              {"sha256", r.sha256},
                              {"resolution", r.grid.resolution()},
                              {"bounds", {{"origin", r.grid.origin}, {"edge", r.grid.edge}}},
                              {"hash_bits", written.hash_bits()},
                              {"voxels", r.voxels},
                              {"svo_nodes", r.svo_nodes},
                              {"dag_nodes", r.dag_nodes},
                              {"bytes", r.bytes},
                              {"levels", levels}};
  add_attribute_facts(written, json);
  json.update(nlohmann::ordered_json{{"cubes", {{"total", r.parts}, {"split", r.parts_split}}},
                                     {"merge_passes", r.merge_passes},
                                     {"work_bytes", r.work_bytes},
                                     {"warnings", r.warnings},
                                     {"wall_s", times.wall_s},
                                     {"cpu_s", times.cpu_s},
                                     {"peak_rss_bytes", peak_resident_bytes()}});
  return json;
}

void run(const ExtractCommand& command, CommandContext& context) {
  query::ExtractSpec spec;
  spec.memory_bytes = memory_limit(command.memory);
  const auto file = open_global_file(command.input);
  spec.selection = command.selection.selection(*file);
  spec.crop = command.crop;
  spec.majority = command.majority;
  spec.output = command.output;
  spec.replace = command.force;
  spec.threads = command.threads;
  const auto progress = make_progress_bar(command.quiet);
  const RunTimer timer;
  const query::ExtractReport report =
      query::extract(*file, spec, context.files, *progress, context.cancel);
  const RunTimes times = timer.elapsed();
  if (command.quiet && !command.json) return;
  if (!command.json) return print(command, report, times);
  print_json(extract_json(command, report, *open_global_file(spec.output), times));
}

void declare(Command& command, ExtractCommand& state) {
  command.option("input", state.input, "the .vdag file").required();
  command.output_option("-o,--output", state.output, "the .vdag file to write").required();
  state.selection.declare(command);
  command.flag("--crop", state.crop,
               "make the smallest octree cube around the region the new grid");
  command.flag("--majority", state.majority,
               "set a cell of a coarser level if at least half of its voxels are set, not if any "
               "is (for solids)");
  command.memory_option(state.memory);
  command.threads_option(state.threads);
  command.flag("--force", state.force, "replace an existing file");
  command.quiet_flag(state.quiet);
  command.json_flag(state.json);
}

}  // namespace

void add_extract_command(CommandLine& line) {
  add_command<ExtractCommand>(line, "extract", "write a region or a coarser level of a DAG");
}

}  // namespace voxdag::cli
