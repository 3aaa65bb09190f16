// The build that tests interrupt and resume: a scene of spheres, divided into a few hundred
// subvolumes and built by one worker.
#pragma once

#include <string>

#include "scene/generate/generate.h"
#include "scheduler/run_build.h"

namespace voxdag {

inline void write_spheres(const std::string& path, uint64_t triangles, uint64_t seed = 1) {
  GenerateOptions options;
  options.kind = SceneKind::kSpheres;
  options.triangles = triangles;
  options.seed = seed;
  NoProgress progress;
  generate_scene(system_files(), path, options, progress, CancelToken{});
}

inline BuildSpec spheres_build(const std::string& scene, const std::string& output) {
  BuildSpec spec;
  spec.geometry.scenes = {scene};
  spec.geometry.resolution = 1024;
  spec.run.output = output;
  spec.run.memory_bytes = uint64_t{256} << 20;
  spec.run.threads = 1;
  spec.run.subvolume_edge = 128;
  return spec;
}

}  // namespace voxdag
