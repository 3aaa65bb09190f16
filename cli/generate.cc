#include "scene/generate/generate.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "cli/output.h"
#include "cli/terminal/progress_bar.h"
#include "core/base/clock.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"

namespace voxdag::cli {
namespace {

struct GenerateCommand {
  std::string kind;
  OutputFile output;
  GenerateOptions options;
  bool quiet = false;
  bool json = false;
};

void print(const GenerateCommand& command, const GenerateReport& r, double wall_s) {
  std::printf("%s: %s, %s triangles, %s", printable_line(command.output.path).c_str(),
              command.kind.c_str(), count_text(r.triangles).c_str(), size_text(r.bytes).c_str());
  if (r.instances > 0)
    std::printf(" (%s triangles stored, %s instances)", count_text(r.stored_triangles).c_str(),
                count_text(r.instances).c_str());
  std::printf(", seed %llu, %s\n", static_cast<unsigned long long>(command.options.seed),
              duration_text(wall_s).c_str());
}

void run(GenerateCommand& command, CommandContext& context) {
  command.options.kind = scene_kind(command.kind).kind;
  GuardedOutputs files(context.files);
  command.output.guard(files);
  command.output.check(files, "", is_generated_scene);
  const auto progress = make_progress_bar(command.quiet);
  const double start_s = wall_seconds();
  const GenerateReport report =
      generate_scene(files, command.output.path, command.options, *progress, context.cancel);
  const double wall_s = wall_seconds() - start_s;
  if (command.quiet && !command.json) return;
  if (!command.json) return print(command, report, wall_s);
  print_json(nlohmann::ordered_json{{"kind", command.kind},
                                    {"seed", command.options.seed},
                                    {"output", command.output.path},
                                    {"triangles", report.triangles},
                                    {"stored_triangles", report.stored_triangles},
                                    {"instances", report.instances},
                                    {"bytes", report.bytes},
                                    {"wall_s", wall_s}});
}

std::string kinds_text() {
  std::string text = "kind of scene:";
  for (const SceneKindInfo& info : scene_kinds())
    text += std::string("\n") + info.name + ": " + info.summary;
  return text;
}

void declare(Command& command, GenerateCommand& state) {
  command.option("kind", state.kind, kinds_text().c_str()).required();
  command.output_option("output", state.output.path, "the .glb file to write").required();
  command.option("--seed", state.options.seed, "seed of the random numbers").show_default();
  command
      .option("--triangles", state.options.triangles,
              "approximate number of triangles (not for menger)")
      .positive();
  command.option("--level", state.options.level, "menger: recursion depth, 0 to 5").show_default();
  command.flag("--instances", state.options.instances,
               "city, spheres: store repeated parts once, with EXT_mesh_gpu_instancing");
  command.flag("--colors", state.options.colors,
               "city: materials and colors of vertices, for build --color; not with --instances");
  state.output.declare_force(command);
  command.quiet_flag(state.quiet);
  command.json_flag(state.json);
}

}  // namespace

void add_generate_command(CommandLine& line) {
  add_command<GenerateCommand>(line, "generate", "generate a scene from a seed");
}

}  // namespace voxdag::cli
