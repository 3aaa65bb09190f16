#include "cli/build_options.h"

#include <charconv>

#include "cli/size.h"
#include "core/base/error.h"

namespace voxdag::cli {
namespace {

std::array<double, 4> parse_bounds(const std::string& text) {
  std::array<double, 4> numbers{};
  const char* at = text.data();
  const char* const end = text.data() + text.size();
  for (size_t i = 0; i < 4; ++i) {
    const auto [rest, failure] = std::from_chars(at, end, numbers[i]);
    const bool last = i == 3;
    if (failure != std::errc{} || (last ? rest != end : rest == end || *rest != ','))
      throw Error(ErrorCode::kInvalidInput,
                  "--bounds '" + text + "': expected four numbers X,Y,Z,EDGE");
    at = rest + 1;
  }
  return numbers;
}

}  // namespace

void BuildOptions::declare(CLI::App& command) {
  GeometryOptions& g = spec_.geometry;
  RunOptions& r = spec_.run;
  command.add_option("scene", g.scenes, "glTF files (.glb, .gltf), together one scene")->required();
  command
      .add_option("-r,--resolution", g.resolution, "voxels an edge, a power of two, 4 to 1048576")
      ->required();
  const char* geometry = "Geometry (decides the result's bytes)";
  auto* bounds = command.add_option("--bounds", bounds_, "the cube: low corner X,Y,Z and its EDGE")
                     ->group(geometry);
  command
      .add_option("--voxel-size", voxel_size_, "edge of a voxel; the cube is centred on the scene")
      ->group(geometry)
      ->excludes(bounds);
  command.add_flag("--skip-invalid", g.skip_invalid, "drop and count invalid triangles")
      ->group(geometry);
  command.add_option("--hash-bits", g.hash_bits, "bits of a node's hash that are kept, 4 to 64")
      ->group(geometry);
  const char* run = "Run (never changes the result)";
  command.add_option("--memory", memory_, "memory budget, 64MiB or more (default: half the RAM)")
      ->group(run);
  command.add_option("--threads", r.threads, "worker threads (default: all cores)")->group(run);
  command
      .add_option("--subvolume", r.subvolume_edge,
                  "edge of a subvolume in voxels, a power of two (default: by the plan)")
      ->group(run);
  command.add_option("--backend", r.backend, "auto or cpu")->group(run);
  command.add_option("--work", r.work_folder, "folder for temporary files (default: OUT.work)")
      ->group(run);
}

BuildSpec BuildOptions::spec() const {
  BuildSpec spec = spec_;
  if (!bounds_.empty()) spec.geometry.bounds = parse_bounds(bounds_);
  if (voxel_size_ != 0) spec.geometry.voxel_size = voxel_size_;
  if (!memory_.empty()) spec.run.memory_bytes = parse_size(memory_, "--memory");
  return spec;
}

}  // namespace voxdag::cli
