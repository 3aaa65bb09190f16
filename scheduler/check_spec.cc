#include "scheduler/check_spec.h"

#include <algorithm>
#include <filesystem>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/process_limits.h"
#include "core/io/overwrite.h"
#include "scene/formats/formats.h"
#include "scheduler/spec/build_fields.h"
#include "scheduler/stages/build/choose_backend.h"
#include "scheduler/stages/ingest/ingest.h"
#include "scheduler/state/build_locks.h"
#include "scheduler/state/job/build_job.h"
#include "scheduler/state/work_folder.h"

namespace voxdag {
namespace {

// Upper limit of the default color resolution, in cells per edge. Colors repeat less often than
// geometry, so the colors of a finer grid could take far more space than the geometry.
constexpr uint64_t kColorResolution = 4096;

bool is_report(const ReadableFile& file) { return begins_with(file, "{\n  \"output\": \""); }

// Throws Error if the backend does not fill solids.
void check_solid(const RunOptions& run) {
  if (run.backend == BackendName::kCuda || run.backend == BackendName::kParallelHost)
    throw Error(ErrorCode::kInvalidInput, std::string("backend ") + name_of(run.backend) +
                                              ": it does not fill solids; expected " +
                                              option_text("backend", "cpu") + " or auto");
}

}  // namespace

BuildSpec checked(const BuildSpec& spec) {
  const GeometryOptions& g = spec.geometry;
  const RunOptions& r = spec.run;
  if (g.scenes.empty())
    throw Error(ErrorCode::kInvalidInput,
                "no scene was given: expected at least one " + list_scene_endings() + " file");
  check_options(spec);
  choose_grid(g, WorldBounds{});  // throws if no grid has these bounds or this voxel size
  check_backend(r, g.rule());
  if (solid_rule_of(g) != SolidRule::kNone) check_solid(r);
  if (r.report == "none" && r.cluster && r.cluster->merge_job)
    throw Error(ErrorCode::kInvalidInput, option_text("report", "none") +
                                              ": expected a report with " +
                                              option_text("cluster_merge") +
                                              ", because the merge job returns its results in it");
  BuildSpec out = spec;
  if (!r.threads) out.run.threads = default_threads();
  if (!r.memory_bytes) out.run.memory_bytes = default_memory();
  if (g.attributes.any() && !g.color_resolution)
    out.geometry.color_resolution = std::min(g.resolution, kColorResolution);
  if (g.cutouts == CutoutRule::kDefault)
    out.geometry.cutouts = g.attributes[Attribute::kColor] ? CutoutRule::kSkip : CutoutRule::kKeep;
  return out;
}

BuildSpec with_resolution(const BuildSpec& spec, const BuildContext& context) {
  const GeometryOptions& g = spec.geometry;
  if (g.resolution || !g.voxel_size) return spec;
  BuildSpec out = spec;
  // checked() accepts any valid value, and it also compares the radius with the resolution.
  out.geometry.resolution = uint64_t{1} << max_levels_of(g);
  const BuildSpec full = checked(out);
  MemoryBudget budget(full.run.memory_bytes);
  const auto scene =
      open_scene(context.files, g.scenes, scene_options_of(g), budget, context.cancel);
  IngestState state;
  state.declared_triangles = scene->declared_triangles();
  scan(*scene, state, {context, full.run.threads, budget}, [] {});
  const uint32_t levels =
      Grid::levels_for_voxel_size(state.bounds, *g.voxel_size, max_levels_of(g));
  out.geometry.resolution = uint64_t{1} << levels;
  return out;
}

void refuse_own_files(const BuildSpec& spec, BuildScene& scene, const std::string& work_folder,
                      std::vector<std::string> outputs, const BuildContext& context) {
  FileSystem& files = context.files;
  std::vector<std::string> own = WorkFolder::files_in(files, work_folder);
  const bool is_first = !own.empty() && !files.exists(WorkFolder::store_path(work_folder));
  own.insert(own.end(), outputs.begin(), outputs.end());
  refuse_inputs(files, own, spec.geometry.scenes);
  // An output file that begins with a zero byte can be an unfinished file of voxdag, or any other
  // file. So the outputs are also compared with the files that the scene's files name.
  const bool is_unknown = std::ranges::any_of(outputs, [&](const std::string& path) {
    const auto file = open_if_there(files, path);
    return file && begins_with(*file, std::string_view("\0", 1));
  });
  if (!is_first && !is_unknown) return;
  std::vector<std::string> inputs;
  for (const SourceFile& file : scene.open().files()) inputs.push_back(file.path);
  refuse_inputs(files, own, inputs);
}

namespace {

void check_report(FileSystem& files, const std::string& report, const std::string& output) {
  if (report == output || report == output + ".partial" || report.ends_with('/'))
    throw Error(ErrorCode::kInvalidInput, option_text("report") + " " + report +
                                              ": expected a file other than the output, or none");
  refuse_foreign_file(files, report, is_report, " (the report)");
  refuse_foreign_file(files, report + ".partial", is_report, " (the report)");
  files.make_directories(parent_directory(report));
}

}  // namespace

void check_places(const BuildSpec& spec, BuildScene& scene, const BuildContext& context) {
  FileSystem& files = context.files;
  const std::string& output = spec.run.output;
  const std::string work = work_folder_of(spec.run);
  if (output.empty())
    throw Error(ErrorCode::kInvalidInput, "no output file was given: expected a path");
  if (output.ends_with('/'))
    throw Error(ErrorCode::kInvalidInput, output + ": expected a file, not a folder");
  const auto resolved = [](const std::string& path) {
    return std::filesystem::weakly_canonical(path + "/.");
  };
  if (!spec.run.cache_folder.empty() && resolved(spec.run.cache_folder) == resolved(work))
    throw Error(ErrorCode::kInvalidInput, work + " is both the cache (" + option_text("cache") +
                                              ") and the work folder: expected two folders");
  const std::string partial = output + ".partial", report = report_path(spec.run);
  std::vector<std::string> outputs = {output, partial, OutputLock::path_of(output)};
  if (!report.empty()) outputs.insert(outputs.end(), {report, report + ".partial"});
  std::erase_if(outputs, [](const std::string& path) { return !refuse_link(path); });
  refuse_own_files(spec, scene, work, outputs, context);
  refuse_foreign_file(files, output, is_global_file, " (-o)");
  // If the work folder has a job, voxdag created the partial file, even if its first bytes are
  // damaged.
  if (!files.exists(WorkFolder::store_path(work)))
    refuse_foreign_file(files, partial, is_partial_global_file, " (-o)");
  files.make_directories(parent_directory(output));
  if (!report.empty()) check_report(files, report, output);
  if (!spec.run.cache_folder.empty()) files.make_directories(spec.run.cache_folder);
}

}  // namespace voxdag
