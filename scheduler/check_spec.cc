#include "scheduler/check_spec.h"

#include <algorithm>
#include <bit>

#include "core/base/error.h"
#include "core/base/process_limits.h"
#include "core/io/overwrite.h"
#include "scene/triangle_source.h"
#include "scheduler/stages/build/choose_backend.h"
#include "scheduler/stages/ingest/ingest.h"
#include "scheduler/state/work_folder.h"

namespace voxdag {
namespace {

// Default resolution of the color grid: colors do not repeat as geometry does.
constexpr uint64_t kColorResolution = 4096;

[[noreturn]] void refuse(const std::string& what) { throw Error(ErrorCode::kInvalidInput, what); }

}  // namespace

BuildSpec checked(const BuildSpec& spec) {
  const GeometryOptions& g = spec.geometry;
  const RunOptions& r = spec.run;
  levels_of_resolution(g.resolution);
  if (g.scenes.empty())
    refuse("no scene was given: expected at least one .glb, .gltf or .ply file");
  if (g.hash_bits < 4 || g.hash_bits > 64)
    refuse("hash bits " + std::to_string(g.hash_bits) + ": expected 4 to 64");
  if (g.bounds && g.voxel_size) refuse("bounds and a voxel size were both given: expected one");
  if (r.memory_bytes && r.memory_bytes < kMinMemory)
    refuse("memory " + std::to_string(r.memory_bytes) + " bytes: expected at least 64 MiB");
  const uint64_t edge = r.subvolume_edge;
  if (edge && ((edge & (edge - 1)) || edge < static_cast<uint64_t>(kSmallestEdge)))
    refuse("subvolume edge " + std::to_string(edge) + ": expected a power of two from 64 voxels");
  if (g.color_resolution && !g.attributes.any())
    refuse("a color resolution was given without colors: expected both (--color, or --attributes)");
  if (g.color_resolution && (!std::has_single_bit(g.color_resolution) || g.color_resolution < 4 ||
                             g.color_resolution > g.resolution))
    refuse("color resolution " + std::to_string(g.color_resolution) +
           ": expected a power of two from 4 to the resolution, " + std::to_string(g.resolution));
  choose_grid(g, WorldBounds{});  // throws for a cube or a voxel size that makes no grid
  check_backend(r);
  BuildSpec out = spec;
  if (!r.threads) out.run.threads = default_threads();
  if (!r.memory_bytes) out.run.memory_bytes = default_memory();
  if (g.attributes.any() && !g.color_resolution)
    out.geometry.color_resolution = std::min(g.resolution, kColorResolution);
  return out;
}

void refuse_own_files(const BuildSpec& spec, const std::string& work_folder,
                      std::span<const std::string> outputs, const BuildContext& context) {
  FileSystem& files = context.files;
  std::vector<std::string> own = WorkFolder::files_in(files, work_folder);
  const bool is_first = !own.empty() && !files.exists(WorkFolder::store_path(work_folder));
  own.insert(own.end(), outputs.begin(), outputs.end());
  refuse_inputs(files, own, spec.geometry.scenes);
  // Anything may begin with zeros, as an unfinished output does.
  const bool is_unknown = std::ranges::any_of(outputs, [&](const std::string& path) {
    const auto file = open_if_there(files, path);
    return file && begins_with(*file, std::string_view("\0", 1));
  });
  if (!is_first && !is_unknown) return;
  MemoryBudget budget(spec.run.memory_bytes);
  const auto scene =
      open_scene(files, spec.geometry.scenes, {.skip_invalid = spec.geometry.skip_invalid}, budget,
                 context.cancel);
  std::vector<std::string> inputs;
  for (const SourceFile& file : scene->files()) inputs.push_back(file.path);
  refuse_inputs(files, own, inputs);
}

}  // namespace voxdag
