#include "server/tiles/partial_views.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "core/base/clock.h"
#include "core/base/error.h"
#include "core/geometry/grid.h"

namespace voxdag::server {
namespace {

constexpr double kInterval_s = 1;
constexpr double kMaxShare = 0.05;  // of one core

std::string describe(const CoarseCubes& cubes, uint64_t resolution) {
  const uint32_t levels = levels_of_resolution(resolution);
  nlohmann::json list = nlohmann::json::array();
  for (const auto& [id, coarse] : cubes.cubes()) {
    const Cube& cube = coarse.cube;
    const int64_t edge = cube.edge_voxels(levels);
    list.push_back({cube.position[0] * edge, cube.position[1] * edge, cube.position[2] * edge, edge,
                    static_cast<uint32_t>(coarse.brick),
                    static_cast<uint32_t>(coarse.brick >> 32)});
  }
  return nlohmann::ordered_json{{"resolution", resolution},
                                {"built", cubes.built()},
                                {"total", cubes.total()},
                                {"cubes", std::move(list)}}
      .dump();
}

}  // namespace

std::string PartialViews::json(const std::string& job, const std::string& work_folder,
                               uint64_t resolution) {
  const auto view = view_of(job);
  const std::lock_guard lock(view->mutex);
  const double start_s = wall_seconds();
  if (start_s < view->next_s) {
    if (view->json.empty())
      throw Error(ErrorCode::kInvalidInput, work_folder + ": nothing could be read a moment ago");
    return view->json;
  }
  // Also if this fails.
  view->next_s = start_s + kInterval_s;
  view->json.clear();
  view->cubes.refresh(files_, work_folder);
  view->json = describe(view->cubes, resolution);
  const double took_s = wall_seconds() - start_s;
  view->next_s = start_s + std::max(kInterval_s, took_s / kMaxShare);
  return view->json;
}

std::shared_ptr<PartialViews::View> PartialViews::view_of(const std::string& job) {
  const std::lock_guard lock(mutex_);
  const auto found = std::find_if(views_.begin(), views_.end(),
                                  [&](const auto& view) { return view->job == job; });
  if (found == views_.end()) {
    views_.push_front(std::make_shared<View>(job));
    if (views_.size() > max_jobs_) views_.pop_back();
  } else {
    views_.splice(views_.begin(), views_, found);
  }
  return views_.front();
}

}  // namespace voxdag::server
