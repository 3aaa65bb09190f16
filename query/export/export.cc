#include "query/export/export.h"

#include <array>

#include "core/base/error.h"
#include "core/format/global/open_global.h"
#include "core/format/global/watched_file.h"
#include "query/dag/locked_outputs.h"
#include "query/export/export_job.h"

namespace voxdag::query {
namespace {

constexpr ExportFormat kFormats[] = {
    {"hashdag", "HashDAG and its descendants", ".basic_dag.dag.bin",
     ".basic_dag.uncompressed_colors.bin", write_hashdag},
    {"svdag", "SymVox / SVDAG-Compression, and DAGger in the browser", nullptr, nullptr,
     write_svdag},
    {"voxel", "PlayCanvas and SuperSplat: NAME.voxel.json and NAME.voxel.bin", ".voxel.json",
     ".voxel.bin", write_voxel},
    {"vox", "MagicaVoxel", nullptr, nullptr, write_vox},
    {"bt", "OctoMap", nullptr, nullptr, write_bt},
#ifdef VOXDAG_HAS_VDB
    {"vdb", "OpenVDB: Blender, Houdini", nullptr, nullptr, write_vdb},
    {"nvdb", "NanoVDB: renderers on GPUs", nullptr, nullptr, write_nvdb},
#endif
    {"ply", "point cloud: the centers of the voxels, world units", nullptr, nullptr, write_ply},
    {"npz", "numpy: the cells and the centers of the voxels", nullptr, nullptr, write_npz},
    {"vtu", "VTK, ParaView: a hexahedron for each voxel, with shared points", nullptr, nullptr,
     write_vtu},
    {"inp", "Abaqus, CalculiX: an element C3D8 for each voxel, with shared nodes", nullptr, nullptr,
     write_inp},
    {"glb", "glTF: a mesh of the surface, for regions", nullptr, nullptr, write_glb},
};

}  // namespace

std::span<const ExportFormat> export_formats() { return kFormats; }

const ExportFormat& export_format(const std::string& name) {
#ifdef VOXDAG_VDB_ADVICE
  if (name == "vdb" || name == "nvdb")
    throw Error(ErrorCode::kInvalidInput,
                "--to " + name + ": this voxdag was built without OpenVDB: " VOXDAG_VDB_ADVICE);
#endif
  std::string names;
  for (const ExportFormat& format : kFormats) {
    if (name == format.name) return format;
    names += std::string(names.empty() ? "" : ", ") + format.name;
  }
  throw Error(ErrorCode::kInvalidInput, "--to " + name + ": expected one of " + names);
}

std::vector<std::string> export_paths(const ExportFormat& format, const std::string& output) {
  if (!format.suffix) return {output};
  const std::string_view suffix = format.suffix;
  if (output.size() <= suffix.size() || !output.ends_with(suffix))
    throw Error(ErrorCode::kInvalidInput, "-o " + output + ": expected a name that ends in '" +
                                              format.suffix + "', which viewers look for");
  const std::string stem = output.substr(0, output.size() - suffix.size());
  return {output, stem + format.second_suffix};
}

ExportReport export_dag(FileSystem& files, const voxdag_reader::File& file,
                        const ExportRequest& request, Progress& progress,
                        const CancelToken& cancel) {
  check_grid(request.selection, file.grid_levels());
  const std::vector<std::string> paths = export_paths(*request.format, request.output);
  LockedOutputs outputs(files, {paths, {file.path()}, request.replace});
  const WatchedFile watched(file);
  MemoryBudget budget(request.memory_bytes);
  const bool has_colors = file.has_colors() && !request.gray;
  const auto write = [&] {
    const DagView dag(file);
    const ExportJob job{outputs.files(), file,         dag,        watched, request.selection,
                        request.output,  paths.back(), has_colors, budget,  progress,
                        cancel};
    if (dag.empty()) refuse_empty(job);
    return request.format->write(job);
  };
  ExportReport report = watched.run([&] { return naming_file(file.path(), write); });
  report.files = paths;
  return report;
}

}  // namespace voxdag::query
