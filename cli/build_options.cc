#include "cli/build_options.h"

#include <sstream>

#include "core/base/error.h"
#include "core/base/text.h"

namespace voxdag::cli {
namespace {

constexpr uint64_t kMaxConfigBytes = uint64_t{1} << 20;
constexpr const char* kRunGroup = "Run (never changes the bytes of the result)";

// Sets options that the command line does not give from a TOML or INI file. CLI11 reads such files
// for the whole program only, not for one command.
void read_config_file(const std::string& path, CLI::App& command) {
  std::istringstream text(read_small_file(system_files(), path, kMaxConfigBytes));
  for (const CLI::ConfigItem& item : CLI::ConfigTOML().from_config(text)) {
    CLI::Option* const option = command.get_option_no_throw("--" + item.fullname());
    if (!option || !option->get_configurable())
      throw Error(ErrorCode::kInvalidInput,
                  path + ": '" + item.fullname() + "' is not an option of " + command.get_name());
    if (option->count() > 0) continue;
    // If the command line gives the option later, that value wins.
    option->multi_option_policy(CLI::MultiOptionPolicy::TakeLast)->add_result(item.inputs);
  }
}

}  // namespace

void BuildOptions::declare(CLI::App& command) {
  GeometryOptions& g = spec_.geometry;
  RunOptions& r = spec_.run;
  command.add_option("scene", g.scenes, "glTF files (.glb, .gltf), together one scene")->required();
  command
      .add_option("-r,--resolution", g.resolution, "voxels per edge, a power of two, 4 to 1048576")
      ->required();
  const char* geometry = "Geometry (decides the bytes of the result)";
  auto* bounds = command.add_option("--bounds", bounds_, "the cube: low corner X,Y,Z and its EDGE")
                     ->group(geometry);
  command
      .add_option("--voxel-size", g.voxel_size,
                  "edge of a voxel; the cube is centered on the scene")
      ->group(geometry)
      ->excludes(bounds);
  command.add_flag("--skip-invalid", g.skip_invalid, "drop and count invalid triangles")
      ->group(geometry);
  command.add_option("--hash-bits", g.hash_bits, "truncate node hashes to this many bits, 4 to 64")
      ->group(geometry);
  command
      .add_option_function<std::string>(
          "--config", [&command](const std::string& path) { read_config_file(path, command); },
          "read options from a TOML or INI file")
      ->trigger_on_parse()
      ->configurable(false);
  command.add_option("--memory", memory_, "memory budget, 64MiB or more (default: half the RAM)")
      ->group(kRunGroup);
  command.add_option("--threads", r.threads, "worker threads (default: all cores)")
      ->group(kRunGroup);
  command
      .add_option("--subvolume", r.subvolume_edge,
                  "edge of a subvolume in voxels, a power of two (default: chosen by the build)")
      ->group(kRunGroup);
  command.add_option("--backend", r.backend, "auto, cpu, cuda or parallel-host")->group(kRunGroup);
  command
      .add_option("--method", r.method,
                  "consing (cpu), pointers or hashes (default: the backend's fastest)")
      ->group(kRunGroup);
}

void BuildOptions::declare_work_folder(CLI::App& command) {
  command
      .add_option("--work", spec_.run.work_folder, "folder for temporary files (default: OUT.work)")
      ->group(kRunGroup);
}

BuildSpec BuildOptions::spec() const {
  BuildSpec spec = spec_;
  if (!bounds_.empty())
    spec.geometry.bounds =
        parse_list<double, 4>("--bounds", bounds_, ',', "four numbers X,Y,Z,EDGE");
  if (!memory_.empty()) {
    spec.run.memory_bytes = parse_size(memory_, "--memory");
    if (spec.run.memory_bytes == 0)
      throw Error(ErrorCode::kInvalidInput, "--memory 0: expected at least 64 MiB");
  }
  return spec;
}

}  // namespace voxdag::cli
