#include "voxdag/build.h"

#include <optional>

#include "core/io/file_system.h"
#include "library/hook_progress.h"
#include "scene/mesh_files.h"
#include "scheduler/plan_build.h"
#include "scheduler/run_build.h"

namespace voxdag {
namespace {

BuildSpec spec_of(const BuildOptions& options) {
  BuildSpec spec;
  GeometryOptions& geometry = spec.geometry;
  geometry.scenes = options.scenes;
  if (options.mesh) geometry.scenes.emplace_back(MeshFiles::kPath);
  geometry.resolution = options.resolution;
  geometry.bounds = options.bounds;
  geometry.voxel_size = options.voxel_size;
  geometry.skip_invalid = options.skip_invalid;
  geometry.thin = options.thin;
  geometry.cutouts = options.cutouts;
  geometry.point_radius = options.point_radius;
  geometry.columns = options.columns;
  geometry.ignore_extension = options.ignore_extension;
  geometry.hash_bits = options.hash_bits;
  geometry.order = options.order;
  geometry.solid = options.solid;
  geometry.seed = options.seed;
  geometry.radius = options.radius;
  geometry.attributes[Attribute::kColor] = options.color;
  geometry.attributes[Attribute::kAlpha] = options.alpha;
  geometry.attributes[Attribute::kNormal] = options.normal;
  geometry.attributes[Attribute::kMaterial] = options.material;
  geometry.color_resolution = options.color_resolution;
  RunOptions& run = spec.run;
  run.output = options.output;
  run.work_folder = options.work_folder;
  run.keep_work = options.keep_work;
  run.restart = options.restart;
  run.force = options.force;
  run.strict = options.strict;
  run.allow_empty = options.allow_empty;
  run.cache_folder = options.cache_folder;
  run.cache_bytes = options.cache_bytes;
  run.memory_bytes = options.memory_bytes;
  run.threads = options.threads;
  run.subvolume_edge = options.subvolume_edge;
  run.backend = options.backend;
  run.method = options.method;
  return spec;
}

// Calls work(spec, context) with the files, hooks and scene of a build.
template <class Work>
auto with_context(const BuildOptions& options, const BuildHooks& hooks, const Work& work) {
  std::optional<MeshFiles> mesh;
  if (options.mesh) mesh.emplace(system_files(), *options.mesh);
  FileSystem& files = mesh ? *mesh : system_files();
  HookProgress progress(hooks);
  const CancelToken never;
  return work(spec_of(options),
              BuildContext{files, progress, hooks.cancel ? *hooks.cancel : never});
}

}  // namespace

BuildResult build(const BuildOptions& options, const BuildHooks& hooks) {
  const BuildReport report = with_context(options, hooks, run_build);
  BuildResult result;
  result.output = report.output;
  result.sha256 = report.sha256;
  result.bytes = report.bytes;
  result.grid_levels = report.grid.levels;
  result.origin = report.grid.origin;
  result.edge = report.grid.edge;
  result.triangles = report.triangles;
  result.dropped_outside = report.dropped_outside;
  result.dropped_invalid = report.dropped_invalid;
  result.voxels = report.merge.voxels;
  result.dag_nodes = report.merge.dag_nodes;
  result.subvolumes = report.subvolumes;
  result.subvolumes_reused = report.subvolumes_reused;
  result.wall_s = report.wall_s;
  result.cpu_s = report.cpu_s;
  result.peak_memory_bytes = report.peak_rss_bytes;
  for (const Warning& warning : report.warnings)
    result.warnings.push_back({warning.code, warning.place, warning.message, warning.count});
  result.json = report_json(report);
  return result;
}

BuildPlan plan(const BuildOptions& options, const BuildHooks& hooks) {
  const Estimate estimate = with_context(options, hooks, plan_build);
  BuildPlan plan;
  plan.triangles = estimate.triangles;
  plan.voxels = estimate.voxels;
  plan.dag_nodes = estimate.dag_nodes;
  plan.file_bytes = estimate.file_bytes;
  plan.disk_bytes = estimate.disk_bytes;
  plan.memory_bytes = estimate.memory_bytes;
  plan.cpu_s = estimate.cpu_s;
  plan.wall_s = estimate.wall_s;
  plan.free_disk = estimate.free_disk;
  plan.free_memory = estimate.free_memory;
  plan.json = estimate_json(estimate);
  return plan;
}

}  // namespace voxdag
