#include "scheduler/state/build_scene.h"

#include <ctime>

#include "scene/formats/formats.h"
#include "scheduler/state/work_folder.h"

namespace voxdag {
namespace {

int64_t unix_ns() {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

}  // namespace

BuildScene::BuildScene(const GeometryOptions& options, const std::string& scratch_folder,
                       MemoryBudget& budget, const BuildContext& context)
    : options_(options),
      scratch_path_(WorkFolder::decoded_path(scratch_folder)),
      budget_(budget),
      context_(context) {}

TriangleSource& BuildScene::open() {
  if (!scene_) {
    opened_ns_ = unix_ns();
    scene_ = open_scene(context_.files, options_.scenes, scene_options(), budget_, context_.cancel);
  }
  return *scene_;
}

SceneOptions BuildScene::scene_options() const {
  return {.skip_invalid = options_.skip_invalid,
          .scratch_path = scratch_path_,
          .point_radius = options_.point_radius.value_or(0),
          .columns = options_.columns,
          .ignored_extensions = options_.ignore_extension};
}

}  // namespace voxdag
