#include "core/format/verify/verify.h"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "cli/output.h"
#include "cli/selection_options.h"
#include "cli/terminal/progress_bar.h"
#include "core/base/process_limits.h"
#include "core/base/text.h"
#include "core/base/text/printable.h"
#include "core/dag/space/cube_walk.h"
#include "core/format/global/open_global.h"
#include "core/format/global/watched_file.h"
#include "query/verify/color_sample.h"
#include "query/verify/interior_sample.h"
#include "query/verify/surface_sample.h"
#include "scene/formats/formats.h"
#include "scene/textures/find_cutouts.h"

namespace voxdag::cli {
namespace {

struct VerifyCommand {
  std::string path;
  std::vector<std::string> scenes;
  SceneOptions scene_options;
  std::string cutouts;
  std::string solid;
  uint32_t radius = 0;
  bool thin = false;
  uint64_t seed = 1;
  std::string memory;
  std::string work;
  unsigned threads = default_threads();
  bool quick = false;
  bool quiet = false;
  bool json = false;
};

struct Sample {
  query::SampleReport voxels;
  std::optional<query::InteriorReport> interior;   // for a solid
  std::optional<query::ColorSampleReport> colors;  // for a file with attributes
};

// Returns the cutouts (the transparent parts of triangles) that the build left out, or nullopt if
// it left out none. Without --cutouts, assumes that a build with colors left them out and that a
// build without colors kept them.
std::optional<Cutouts> cutouts_of(const VerifyCommand& command, const voxdag_reader::File& file,
                                  const TriangleSource& scene, MemoryBudget& budget,
                                  CommandContext& context) {
  const bool is_skipped = command.cutouts.empty() ? attributes_of(file).has(Attribute::kColor)
                                                  : command.cutouts == "skip";
  const SceneMaterials materials = is_skipped ? scene.materials() : SceneMaterials{};
  if (!may_have_cutouts(materials)) return std::nullopt;
  WarningList problems;
  return find_cutouts(context.files, materials, command.threads, budget, context.cancel, problems);
}

query::InteriorReport compare_solid(const VerifyCommand& command, const voxdag_reader::File& file,
                                    TriangleSource& scene, const Grid& grid, Progress& progress,
                                    CommandContext& context) {
  if (command.solid == "enclosed")
    return query::compare_enclosed(file, scene, grid, command.radius, command.seed, progress,
                                   context.cancel);
  const SolidRule rule = command.solid == "winding" ? SolidRule::kWinding : SolidRule::kParity;
  return query::compare_interior(file, scene, grid, rule, command.seed, progress, context.cancel);
}

Sample check_against(const VerifyCommand& command, const voxdag_reader::File& file,
                     Progress& progress, CommandContext& context) {
  const Grid grid = grid_of(file);
  const bool has_attributes = attributes_of(file).any();
  MemoryBudget budget(memory_limit(command.memory));
  const auto scene =
      open_scene(context.files, command.scenes, command.scene_options, budget, context.cancel);
  const std::optional<Cutouts> found = cutouts_of(command, file, *scene, budget, context);
  const Cutouts* const cutouts = found ? &*found : nullptr;
  const auto boxes =
      query::sample_surface(*scene, grid, command.seed, progress, context.cancel, cutouts,
                            command.thin ? VoxelRule::kThin : VoxelRule::kShell);
  Sample sample;
  with_reader_errors([&] {
    sample.voxels = query::compare_with_sample(file, boxes, !command.solid.empty());
    if (!command.solid.empty())
      sample.interior = compare_solid(command, file, *scene, grid, progress, context);
    if (has_attributes)
      sample.colors = query::compare_sampled_colors(
          file, grid, context.files, *scene, command.seed, file.path() + ".images.vdspill",
          command.threads, budget, progress, context.cancel, cutouts);
  });
  for (const Warning& warning : scene->warnings())
    if (warning.code == "unused-option") progress.warn(warning.message);
  return sample;
}

void print(const voxdag_reader::File& file, const std::optional<Sample>& sample) {
  std::printf("%s: valid; %s voxels, %s octree nodes, %s DAG nodes\n",
              printable_line(file.path()).c_str(), count_text(file.voxels()).c_str(),
              count_text(file.svo_nodes()).c_str(), count_text(file.dag_nodes()).c_str());
  if (sample)
    std::printf("  equal to the scene: %s voxels compared in %s boxes near its surface, %s set\n",
                count_text(sample->voxels.voxels).c_str(), count_text(sample->voxels.boxes).c_str(),
                count_text(sample->voxels.set).c_str());
  if (sample && sample->interior)
    std::printf("  %s random voxels of the solid compared, %s inside%s\n",
                count_text(sample->interior->voxels).c_str(),
                count_text(sample->interior->inside).c_str(),
                sample->interior->is_closed
                    ? ""
                    : "; the surface is not closed, so only voxels that it touches are compared");
  if (sample && sample->colors)
    std::printf(
        "  %ss like the scene's: %s cells compared in %llu regions, of which %llu are "
        "equal byte for byte\n",
        name_of(attributes_of(file).list().front()), count_text(sample->colors->cells).c_str(),
        static_cast<unsigned long long>(sample->colors->regions),
        static_cast<unsigned long long>(sample->colors->equal));
}

nlohmann::ordered_json verify_json(const VerifyCommand& command, const voxdag_reader::File& file,
                                   uint64_t work_bytes, const std::optional<Sample>& sample) {
  nlohmann::ordered_json json{{"ok", true},
                              {"voxels", file.voxels()},
                              {"svo_nodes", file.svo_nodes()},
                              {"dag_nodes", file.dag_nodes()},
                              {"bytes", file.file_bytes()},
                              {"work_bytes", work_bytes},
                              {"peak_rss_bytes", peak_resident_bytes()}};
  if (sample)
    json["against"] = {{"seed", command.seed},
                       {"boxes", sample->voxels.boxes},
                       {"voxels", sample->voxels.voxels},
                       {"set", sample->voxels.set}};
  if (sample && sample->interior)
    json["against"]["interior"] = {{"closed", sample->interior->is_closed},
                                   {"voxels", sample->interior->voxels},
                                   {"inside", sample->interior->inside}};
  if (sample && sample->colors)
    json["against"]["colors"] = {{"regions", sample->colors->regions},
                                 {"equal", sample->colors->equal},
                                 {"cells", sample->colors->cells}};
  return json;
}

void check_rule(const VerifyCommand& command) {
  if (command.thin && !command.solid.empty())
    throw Error(ErrorCode::kInvalidInput, "--thin: expected no --solid at the same time");
  if (command.radius == 0 || (command.solid == "enclosed" && command.radius <= kMaxRadius)) return;
  throw Error(ErrorCode::kInvalidInput, "--radius " + std::to_string(command.radius) +
                                            ": expected 0 to " + std::to_string(kMaxRadius) +
                                            ", with --solid enclosed");
}

void run(const VerifyCommand& command, CommandContext& context) {
  check_rule(command);
  const auto file = open_global_file(command.path);
  const WatchedFile watched(*file);
  const auto progress = make_progress_bar(command.quiet);
  const uint64_t memory_bytes = memory_limit(command.memory);
  MemoryBudget budget(memory_bytes);
  PageLimit pages(*file, memory_bytes);
  VerifyScratch scratch(context.files, work_prefix(command.path, command.work));
  std::optional<Sample> sample;
  watched.run([&] {
    verify_global_file(*file, command.threads, budget, *progress, context.cancel,
                       global_layout::kNarrowLevelWords, command.quick, &pages, &scratch);
    if (!command.scenes.empty()) sample = check_against(command, *file, *progress, context);
    watched.check_readable();
  });
  if (command.json)
    print_json(verify_json(command, *file, scratch.bytes_written(), sample));
  else if (!command.quiet)
    print(*file, sample);
}

void declare(Command& command, VerifyCommand& state) {
  command.option("file", state.path, "the .vdag file").required();
  const Option against =
      command.option("--against", state.scenes,
                     "compare a sample of voxels, and of colors, with the triangles of this scene");
  const auto of_scene = [&](Option option) { return option.needs(against); };
  of_scene(command.option("--seed", state.seed, "seed of the sample that --against compares"))
      .show_default();
  command.option("--memory", state.memory,
                 "memory for tables and for the scene of --against, and limit above which pages "
                 "of the file are dropped; default: half the RAM");
  command.option("--work", state.work,
                 "folder for temporary files if the tables do not fit in --memory; default: the "
                 "folder of the file");
  of_scene(command.flag("--skip-invalid", state.scene_options.skip_invalid,
                        "drop invalid triangles of the scene, as the build did"));
  of_scene(command.option("--cutouts", state.cutouts, "skip or keep, as in the build"))
      .one_of({"skip", "keep"});
  of_scene(command.option("--solid", state.solid, "winding, parity or enclosed, as in the build"))
      .one_of({"winding", "parity", "enclosed"});
  of_scene(command.option("--radius", state.radius, "radius of the solid, as in the build"));
  of_scene(command.flag("--thin", state.thin, "the build set thin voxels (--thin)"));
  of_scene(command.option("--point-radius", state.scene_options.point_radius,
                          "half edge of the cube that replaces each point, as in the build"));
  of_scene(command.option("--columns", state.scene_options.columns,
                          "columns of text files with points, as in the build"));
  of_scene(command.option("--ignore-extension", state.scene_options.ignored_extensions,
                          "required extension of a glTF file to ignore, as in the build; "
                          "repeatable"))
      .one_value_each();
  command.flag("--quick", state.quick,
               "in a file in the order first-parent, do not look for equal nodes");
  command.threads_option(state.threads);
  command.quiet_flag(state.quiet);
  command.json_flag(state.json);
}

}  // namespace

void add_verify_command(CommandLine& line) {
  add_command<VerifyCommand>(line, "verify", "check every invariant of a DAG");
}

}  // namespace voxdag::cli
