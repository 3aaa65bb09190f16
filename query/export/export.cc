#include "query/export/export.h"

#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "core/base/error.h"
#include "core/base/options/option_text.h"
#include "core/base/process_limits.h"
#include "core/format/global/open_global.h"
#include "core/format/global/watched_file.h"
#include "core/format/verify/verify_checksums.h"
#include "query/dag/locked_outputs.h"
#include "query/export/dag_export.h"
#include "query/export/export_job.h"
#include "query/export/level_set/narrow_band.h"
#include "query/lookup/bricks.h"

namespace voxdag::query {
namespace {

constexpr ExportFormat kFormats[] = {
    {"hashdag", "HashDAG and its descendants", ".basic_dag.dag.bin",
     ".basic_dag.uncompressed_colors.bin", write_hashdag},
    {"svdag", "SymVox / SVDAG-Compression, and DAGger in the browser", nullptr, nullptr,
     write_svdag},
    {"voxel", "PlayCanvas and SuperSplat: NAME.voxel.json and NAME.voxel.bin", ".voxel.json",
     ".voxel.bin", write_voxel},
    {"vox", "MagicaVoxel", nullptr, nullptr, write_vox, UpAxis::kZ},
    {"bt", "OctoMap", nullptr, nullptr, write_bt},
    {"ot", "OctoMap with colors, or with occupancies", nullptr, nullptr, write_ot},
#ifdef VOXDAG_HAS_VDB
    {"vdb", "OpenVDB: Blender, Houdini", nullptr, nullptr, write_vdb, UpAxis::kY, " grid band"},
    {"nvdb", "NanoVDB: renderers on GPUs", nullptr, nullptr, write_nvdb, UpAxis::kY, " grid band"},
#endif
    {"ply", "point cloud: the centers of the voxels, world units", nullptr, nullptr, write_ply},
    {"npz", "numpy: the cells and the centers of the voxels", nullptr, nullptr, write_npz,
     UpAxis::kY, " compact"},
    {"vtu", "VTK, ParaView: a hexahedron for each voxel, with shared points", nullptr, nullptr,
     write_vtu},
    {"inp", "Abaqus, CalculiX: an element C3D8 for each voxel, with shared nodes", nullptr, nullptr,
     write_inp},
    {"glb", "glTF: a mesh of the surface, for regions", nullptr, nullptr, write_glb, UpAxis::kY,
     " outside watertight"},
};

// Returns the turn (axis_turn.h) after which the y axis of the .vdag file points along `up` in the
// exported file. Without a turn, this axis points along format.up.
AxisTurn turn_of(const ExportFormat& format, UpAxis up) {
  if (up == UpAxis::kOfFormat || up == format.up) return {};
  return up == UpAxis::kZ ? kTurnYToZ : kTurnZToY;
}

}  // namespace

std::span<const ExportFormat> export_formats() { return kFormats; }

const ExportFormat& export_format(const std::string& name) {
#ifdef VOXDAG_VDB_ADVICE
  if (name == "vdb" || name == "nvdb")
    throw Error(
        ErrorCode::kInvalidInput,
        option_text("to", name) + ": this voxdag was built without OpenVDB: " VOXDAG_VDB_ADVICE);
#endif
  std::string names;
  for (const ExportFormat& format : kFormats) {
    if (name == format.name) return format;
    names += std::string(names.empty() ? "" : ", ") + format.name;
  }
  throw Error(ErrorCode::kInvalidInput, option_text("to", name) + ": expected one of " + names);
}

void check_export_options(const ExportFormat& format, const ExportOptions& options) {
  const std::pair<const char*, bool> given[] = {{"grid", options.grid != GridKind::kOfFormat},
                                                {"band", options.band.has_value()},
                                                {"compact", options.compact},
                                                {"outside", options.outside},
                                                {"watertight", options.watertight}};
  for (const auto& [name, is_given] : given) {
    const auto has = [name = std::string(" ") + name](const ExportFormat& other) {
      return (other.options + std::string(" ")).find(name + " ") != std::string::npos;
    };
    if (!is_given || has(format)) continue;
    std::string formats;
    for (const ExportFormat& other : kFormats)
      if (has(other)) formats += std::string(formats.empty() ? "" : " or ") + other.name;
    throw FieldError(name, (formats.empty() ? "a format that this voxdag was built without"
                                            : "the format " + formats) +
                               ", not " + format.name);
  }
  if (options.band && options.grid != GridKind::kSdf) throw FieldError("band", "also the grid sdf");
  if (options.band && (*options.band < 1 || *options.band > kMaxExportBand))
    throw FieldError("band", "a whole number from 1 to " + std::to_string(kMaxExportBand));
}

nlohmann::ordered_json facts_json(const ExportReport& report) {
  const auto number = [](double value) {
    const auto whole = static_cast<int64_t>(value);
    return static_cast<double>(whole) == value ? nlohmann::ordered_json(whole)
                                               : nlohmann::ordered_json(value);
  };
  auto facts = nlohmann::ordered_json::object();
  for (const auto& [name, numbers] : report.facts) {
    if (numbers.size() == 1)
      facts[name] = number(numbers[0]);
    else
      for (const double value : numbers) facts[name].push_back(number(value));
  }
  return facts;
}

std::vector<std::string> export_paths(const ExportFormat& format, const std::string& output) {
  if (!format.suffix) return {output};
  const std::string_view suffix = format.suffix;
  if (output.size() <= suffix.size() || !output.ends_with(suffix))
    throw Error(ErrorCode::kInvalidInput, output + ": expected a name that ends in '" +
                                              format.suffix + "', which viewers look for");
  const std::string stem = output.substr(0, output.size() - suffix.size());
  return {output, stem + format.second_suffix};
}

DagExport::DagExport(const voxdag_reader::File& file, const ExportRequest& request)
    : file_(file),
      request_(request),
      turn_(turn_of(*request.format, request.options.up)),
      budget_(request.memory_bytes),
      dag_(file) {
  check_export_options(*request.format, request.options);
}

void DagExport::verify(Progress& progress, const CancelToken& cancel) {
  if (is_verified_) return;
  PageLimit pages(file_, request_.memory_bytes);
  verify_checksums(file_, default_threads(), pages, progress, cancel);
  is_verified_ = true;
}

bool DagExport::has_contents(const Selection& selection) const {
  if (request_.options.grid == GridKind::kSdf)
    return has_band(dag_, selection, request_.options.band_width());
  bool found = false;
  for_each_brick(dag_, selection, [&](const Brick&) { return !(found = true); });
  return found;
}

void DagExport::require_inside(const CancelToken& cancel) {
  if (!has_inside_ && !has_inside(dag_, cancel))
    throw Error(ErrorCode::kInvalidInput,
                file_.path() + ": the voxels are a surface without an inside, so " +
                    option_text("grid", "sdf") + " has no signs: expected a file of " +
                    command_text("build", "solid", "RULE") + ", or " +
                    option_text("grid", "density"));
  has_inside_ = true;
}

void DagExport::fill(const DagView& dag, uint32_t grid_levels, const CancelToken& cancel) {
  if (filled_ && filled_->view().grid_levels() == grid_levels) return;
  filled_.reset();
  filled_.emplace(dag, grid_levels, file_.path(), budget_, cancel);
}

ExportReport DagExport::write(FileSystem& files, const Selection& selection,
                              const std::string& output, Progress& progress,
                              const CancelToken& cancel) {
  check_grid(selection, file_.grid_levels());
  const std::vector<std::string> paths = export_paths(*request_.format, output);
  LockedOutputs outputs(files, {paths, {file_.path()}, request_.replace});
  const WatchedFile watched(file_);
  Selection turned = selection;
  turned.region = turn_.turned(selection.region, int64_t{1} << selection.grid_levels);
  const std::function<void()> verified = [&] { verify(progress, cancel); };
  const auto write = [&] {
    if (!turn_.is_none() && !turned_ && !dag_.empty())
      turned_.emplace(dag_, turn_, file_.path(), budget_, cancel);
    const DagView& dag = turned_ ? turned_->view() : dag_;
    if (request_.options.outside && !dag.empty()) fill(dag, selection.grid_levels, cancel);
    const ExportJob job{outputs.files(),
                        file_,
                        dag,
                        watched,
                        verified,
                        turned,
                        output,
                        paths.back(),
                        file_.has_colors() && !request_.gray,
                        budget_,
                        progress,
                        cancel,
                        turn_,
                        request_.options,
                        filled_ ? &filled_->view() : nullptr};
    if (dag_.empty()) refuse_empty(job);
    if (request_.options.grid == GridKind::kSdf) require_inside(cancel);
    return request_.format->write(job);
  };
  ExportReport report = watched.run([&] { return naming_file(file_.path(), write); });
  report.files = paths;
  return report;
}

ExportReport export_dag(FileSystem& files, const voxdag_reader::File& file,
                        const ExportRequest& request, Progress& progress,
                        const CancelToken& cancel) {
  return DagExport(file, request).write(files, request.selection, request.output, progress, cancel);
}

}  // namespace voxdag::query
