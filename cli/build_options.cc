#include "cli/build_options.h"

#include "core/base/error.h"
#include "core/base/text.h"

namespace voxdag::cli {
namespace {

constexpr const char* kRunGroup = "Run (never changes the bytes of the result)";

}  // namespace

void BuildOptions::declare(Command& command) {
  GeometryOptions& g = spec_.geometry;
  RunOptions& r = spec_.run;
  command.option("scene", g.scenes, "glTF and PLY files (.glb, .gltf, .ply), together one scene")
      .required();
  command.option("-r,--resolution", g.resolution, "voxels per edge, a power of two, 4 to 1048576")
      .required();
  const char* geometry = "Geometry (decides the bytes of the result)";
  const Option bounds =
      command.option("--bounds", bounds_, "the cube: low corner X,Y,Z and its EDGE")
          .group(geometry);
  command.option("--voxel-size", g.voxel_size, "edge of a voxel; the cube is centered on the scene")
      .group(geometry)
      .excludes(bounds);
  command.flag("--skip-invalid", g.skip_invalid, "drop and count invalid triangles")
      .group(geometry);
  command.option("--hash-bits", g.hash_bits, "truncate node hashes to this many bits, 4 to 64")
      .group(geometry);
  command
      .flag("--color", g.attributes[Attribute::kColor], "store the colors of the scene's materials")
      .group(geometry);
  command
      .option("--attributes", attributes_,
              "store these of the cells of the color grid, separated by commas: color, alpha, "
              "normal, material")
      .group(geometry);
  command
      .option("--color-resolution", g.color_resolution,
              "cells per edge of the color grid, a power of two, at most the resolution (default: "
              "the resolution, 4096 at most)")
      .group(geometry);
  command.config_option();
  command.option("--memory", memory_, "memory budget, 64MiB or more (default: half the RAM)")
      .group(kRunGroup);
  command.option("--threads", r.threads, "worker threads (default: all cores)").group(kRunGroup);
  command
      .option("--subvolume", r.subvolume_edge,
              "edge of a subvolume in voxels, a power of two (default: chosen by the build)")
      .group(kRunGroup);
  command.option("--backend", r.backend, "auto, cpu, cuda or parallel-host").group(kRunGroup);
  command
      .option("--method", r.method,
              "consing (cpu), pointers or hashes (default: the backend's fastest)")
      .group(kRunGroup);
}

void BuildOptions::declare_work_folder(Command& command) {
  command.option("--work", spec_.run.work_folder, "folder for temporary files (default: OUT.work)")
      .group(kRunGroup);
}

BuildSpec BuildOptions::spec() const {
  BuildSpec spec = spec_;
  if (!bounds_.empty())
    spec.geometry.bounds =
        parse_list<double, 4>("--bounds", bounds_, ',', "four numbers X,Y,Z,EDGE");
  if (!attributes_.empty())
    for (const Attribute attribute : parse_attributes(attributes_, "--attributes").list())
      spec.geometry.attributes.add(attribute);
  if (!memory_.empty()) {
    spec.run.memory_bytes = parse_size(memory_, "--memory");
    if (spec.run.memory_bytes == 0)
      throw Error(ErrorCode::kInvalidInput, "--memory 0: expected at least 64 MiB");
  }
  return spec;
}

}  // namespace voxdag::cli
