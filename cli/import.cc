#include "scene/import/import.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "cli/output.h"
#include "cli/selection_options.h"
#include "cli/terminal/progress_bar.h"
#include "core/base/clock.h"
#include "core/base/process_limits.h"
#include "core/base/text.h"
#include "core/fields/json_fields.h"
#include "scheduler/state/job_progress.h"

namespace voxdag::cli {
namespace {

struct ImportCommand {
  std::string input, memory;
  OutputFile output;
  bool strict = false, quiet = false, json = false;
};

void print(const ImportCommand& command, const ImportReport& r, double wall_s) {
  std::printf("%s: %s triangles, %s meshes, %s nodes, %s materials, %s images, %s, %s\n",
              command.output.path.c_str(), count_text(r.triangles).c_str(),
              count_text(r.meshes).c_str(), count_text(r.nodes).c_str(),
              count_text(r.materials).c_str(), count_text(r.images).c_str(),
              size_text(r.bytes).c_str(), duration_text(wall_s).c_str());
}

void run(const ImportCommand& command, CommandContext& context) {
  GuardedOutputs files(context.files);
  command.output.guard(files);
  command.output.check(files, command.input, is_imported_scene);
  const uint64_t memory_bytes = memory_limit(command.memory);
  const auto progress = make_progress_bar(command.quiet);
  auto warnings = nlohmann::ordered_json::array();
  const auto warn = [&](const Warning& warning) {
    if (command.strict) refuse_warning(warning);
    progress->warn_of_input(warning);
    warnings.push_back(record_json(warning));
  };
  const double start_s = wall_seconds();
  const ImportReport report = import_scene(files, command.input, command.output.path, memory_bytes,
                                           warn, *progress, context.cancel);
  const double wall_s = wall_seconds() - start_s;
  if (command.quiet && !command.json) return;
  if (!command.json) return print(command, report, wall_s);
  print_json(nlohmann::ordered_json{{"input", command.input},
                                    {"output", command.output.path},
                                    {"triangles", report.triangles},
                                    {"meshes", report.meshes},
                                    {"nodes", report.nodes},
                                    {"materials", report.materials},
                                    {"images", report.images},
                                    {"bytes", report.bytes},
                                    {"warnings", warnings},
                                    {"wall_s", wall_s}});
}

void declare(Command& command, ImportCommand& state) {
  command
      .option("input", state.input,
              "the scene file: .fbx, .dae, .3ds, .3mf, .off and others (docs/scenes.md)")
      .required();
  command.output_option("output", state.output.path, "the .glb file to write").required();
  command.option("--memory", state.memory,
                 "limit of the memory that is allocated (default: half the RAM; at least 64MiB)");
  command.flag("--strict", state.strict, "treat warnings about the scene as errors");
  state.output.declare_force(command);
  command.quiet_flag(state.quiet);
  command.json_flag(state.json);
}

}  // namespace

void add_import_command(CommandLine& line) {
  add_command<ImportCommand>(line, "import", "convert a scene of another format to .glb");
}

}  // namespace voxdag::cli
