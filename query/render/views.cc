#include "query/render/views.h"

#include <algorithm>

#include "core/base/error.h"
#include "query/ray_caster.h"
#include "query/render/sampling.h"

namespace voxdag::query {
namespace {

constexpr double kFar = 1e30;
constexpr double kOutsideFov = 32, kInsideFov = 62;
constexpr double kMinEnclosureOfRooms = 0.1;

struct NamedDirection {
  const char* name;
  Vec toward_eye;
};
// The front of a glTF scene is +z, up is +y; "iso" is to the right of the front, and above.
const NamedDirection kDirections[] = {
    {"iso", {{0.62, 0.55, 1}}}, {"front", {{0, 0, 1}}}, {"back", {{0, 0, -1}}},
    {"left", {{-1, 0, 0}}},     {"right", {{1, 0, 0}}}, {"top", {{0, 1, 0}}},
};

// The width of rays that choose a view of a large grid. Its finer cells are all over the file,
// which may have to be read from a disk, to the same effect.
double finest_width(const DagView& dag) {
  constexpr int64_t kCells = 4096;
  return dag.resolution() > kCells ? static_cast<double>(dag.resolution() / kCells) : 0;
}

// How far one sees from places on the surface, as a share of the scene's diagonal; a place from
// which one can see out of the scene counts as 0. Near 0 for an object, or for caves; more for
// interiors.
double enclosure(const RayCaster& caster, const DagView& dag, const Box& box,
                 const CancelToken& cancel) {
  constexpr size_t kPlaces = 1000;
  const std::vector<Vec> points = occupied_points(dag);
  std::vector<Vec> directions;  // toward the 26 neighbors of a cell
  for (int i = 0; i < 27; ++i)
    if (i != 13) directions.push_back(normalized({{i / 9 - 1.0, i / 3 % 3 - 1.0, i % 3 - 1.0}}));
  const double start = 3 * static_cast<double>(dag.resolution()) / 64;
  const double width = std::max(1.0, finest_width(dag));
  double sum = 0;
  for (size_t i = 0; i < kPlaces; ++i) {
    cancel.check();
    const Vec& place = points[i * points.size() / kPlaces];
    double longest = 0;
    for (const Vec& direction : directions) {
      Hit hit;
      const bool escaped = !caster.cast({place, direction}, {width, 0}, start, box.diagonal(), hit);
      longest = escaped ? 0 : std::max(longest, hit.t);
      if (escaped) break;
    }
    sum += longest;
  }
  return sum / (kPlaces * box.diagonal());
}

// How much there is to see, by a few rays: higher for long views with much detail, lower close to a
// wall or where the camera looks out of the scene. A distance below `near` is too close.
template <int kColumns, int kRows>
double score(const RayCaster& caster, const Placement& placement, double width, double near) {
  constexpr double kRays = kColumns * kRows;
  const Camera camera(placement, kColumns, kRows);
  double depth[kRows][kColumns], sum = 0;
  int close = 0, out = 0, breaks = 0;
  // Along a plane 1 / depth is linear.
  const auto bends = [](double a, double b, double c) {
    return std::fabs(1 / a - 2 / b + 1 / c) * b > 0.03;
  };
  for (int y = 0; y < kRows; ++y)
    for (int x = 0; x < kColumns; ++x) {
      Hit hit;
      const bool seen =
          caster.cast(camera.ray(x + 0.5, y + 0.5), {width, camera.pixel_spread()}, 0, kFar, hit);
      const double d = depth[y][x] = seen ? std::max(hit.t, 1.0) : kFar;
      close += d < near;
      out += !seen;
      sum += seen ? d : 0;
      if (x > 1) breaks += bends(depth[y][x - 2], depth[y][x - 1], d);
      if (y > 1) breaks += bends(depth[y - 2][x], depth[y - 1][x], d);
    }
  const double free = 1 - close / kRays, within = 1 - out / kRays;
  return breaks / kRays * std::sqrt(sum / kRays) * free * free * free * within;
}

// The best-scoring of some hundreds of random places in the lower half of the scene. A quarter of
// the rays tells which of them could be that.
Placement inside_view(const RayCaster& caster, const Box& box, double width, double fov_degrees,
                      const CancelToken& cancel) {
  constexpr uint64_t kPlaces = 400;
  constexpr int kYaws = 8;
  constexpr double kRoughShare = 0.6;  // of the best rough score; lower could not be the best
  const Sampler sampler(2);
  const Vec extent = box.high - box.low;
  const double near = 0.04 * box.diagonal();
  std::vector<Placement> trials;
  std::vector<double> rough;
  for (uint64_t i = 0; i < kPlaces; ++i) {
    const Sampler::Pair across = sampler.pair(2 * i), up = sampler.pair(2 * i + 1);
    const Vec eye =
        box.low + Vec{{extent[0] * (0.05 + 0.9 * across.u), extent[1] * (0.05 + 0.35 * up.u),
                       extent[2] * (0.05 + 0.9 * across.v)}};
    cancel.check();
    for (int yaw = 0; yaw < kYaws; ++yaw) {
      const double angle = 2 * kPi * (yaw + up.v) / kYaws;
      const Vec forward{{std::cos(angle), 0.08, std::sin(angle)}};
      trials.push_back({eye, eye + forward * (0.25 * box.diagonal()), fov_degrees});
      rough.push_back(score<12, 7>(caster, trials.back(), width, near));
    }
  }
  const double least = kRoughShare * *std::max_element(rough.begin(), rough.end());
  Placement best{box.center(), box.center() + Vec{{1, 0, 0}}, fov_degrees};
  double best_score = 0;
  for (size_t i = 0; i < trials.size(); ++i) {
    if (rough[i] < least) continue;
    cancel.check();
    const double trial_score = score<24, 14>(caster, trials[i], width, near);
    if (trial_score <= best_score) continue;
    best_score = trial_score;
    best = trials[i];
  }
  return best;
}

}  // namespace

std::array<double, 3> world_point(const Vec& point, const voxdag_reader::File& file) {
  const double voxel = file.edge() / static_cast<double>(file.resolution());
  std::array<double, 3> world{};
  for (int axis = 0; axis < 3; ++axis)
    world[static_cast<size_t>(axis)] = file.origin()[axis] + point[axis] * voxel;
  return world;
}

Box occupied_box(const DagView& dag) {
  Box box{{{1e30, 1e30, 1e30}}, {}};
  const auto reaches_out = [&](const DagView::Cell& cell) {
    for (int axis = 0; axis < 3; ++axis)
      if (cell.low[axis] < box.low[axis] || cell.low[axis] + cell.edge > box.high[axis])
        return 0xffu;
    return 0u;
  };
  dag.for_each_cell(std::min(dag.grid_levels(), 11u), reaches_out, [&](const DagView::Cell& cell) {
    for (int axis = 0; axis < 3; ++axis) {
      box.low[axis] = std::min(box.low[axis], cell.low[axis]);
      box.high[axis] = std::max(box.high[axis], cell.low[axis] + cell.edge);
    }
  });
  return box;
}

std::vector<Vec> occupied_points(const DagView& dag) {
  std::vector<Vec> points;
  const auto everywhere = [](const DagView::Cell&) { return 0xffu; };
  dag.for_each_cell(std::min(dag.grid_levels(), 6u), everywhere, [&](const DagView::Cell& cell) {
    const double half = cell.edge / 2;
    points.push_back(cell.low + Vec{{half, half, half}});
  });
  return points;
}

const std::vector<std::string>& view_names() {
  static const std::vector<std::string> names = {"auto", "iso",   "front", "back",
                                                 "left", "right", "top",   "inside"};
  return names;
}

Placement named_view(const std::string& name, const DagView& dag, double aspect,
                     std::optional<double> fov_degrees, const CancelToken& cancel) {
  const bool automatic = name == "auto";
  if (name == "inside" || automatic) {
    const RayCaster caster(dag);
    const Box box = occupied_box(dag);
    if (!automatic || enclosure(caster, dag, box, cancel) > kMinEnclosureOfRooms)
      return inside_view(caster, box, finest_width(dag), fov_degrees.value_or(kInsideFov), cancel);
  }
  for (const NamedDirection& d : kDirections)
    if ((automatic ? "iso" : name) == d.name)
      return fit_camera(occupied_points(dag), d.toward_eye, fov_degrees.value_or(kOutsideFov),
                        aspect);
  throw Error(ErrorCode::kInvalidInput, "view '" + name + "': expected one of view_names()");
}

}  // namespace voxdag::query
