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
    SceneOptions options = scene_options_of(options_);
    options.scratch_path = scratch_path_;
    scene_ = open_scene(context_.files, options_.scenes, options, budget_, context_.cancel);
  }
  return *scene_;
}

SceneOptions scene_options_of(const GeometryOptions& options) {
  return {.skip_invalid = options.skip_invalid,
          .point_radius = options.point_radius.value_or(0),
          .columns = options.columns,
          .ignored_extensions = options.ignore_extension};
}

}  // namespace voxdag
