#include "query/render/views.h"

#include <algorithm>

#include "core/base/error.h"
#include "query/rays/ray_caster.h"
#include "query/render/sampling.h"

namespace voxdag::query {
namespace {

constexpr double kFar = 1e30;
constexpr double kOutsideFov = 32, kInsideFov = 62;
constexpr double kMinEnclosureOfRooms = 0.1;
constexpr size_t kFewCells = 256;  // fewer cells than this do not show the outline of a scene

struct NamedDirection {
  const char* name;
  Vec toward_eye;
};
// In a glTF scene, front is +z and up is +y. "iso" is to the right of the front, and above.
const NamedDirection kDirections[] = {
    {"iso", {{0.62, 0.55, 1}}}, {"front", {{0, 0, 1}}}, {"back", {{0, 0, -1}}},
    {"left", {{-1, 0, 0}}},     {"right", {{1, 0, 0}}}, {"top", {{0, 1, 0}}},
};

// Returns the width, in voxels, of the rays that are cast to choose a view: 1/4096 of the grid's
// edge, or 0 if the grid has at most 4096 voxels per edge. Thinner rays would visit finer cells.
// Finer cells give the same view, but they are scattered over the file, so reading them from disk
// would take time.
double finest_width(const DagView& dag) {
  constexpr int64_t kCells = 4096;
  return dag.resolution() > kCells ? static_cast<double>(dag.resolution() / kCells) : 0;
}

// Limits of the work for choosing a view. A step is a node or brick that is read. The search is
// inside_view(), which rates views in two passes: roughly, then with more rays. Without limits, a
// scene of dust, whose rays pass through thousands of cells, or a damaged scene could keep a
// service busy for minutes. Sponza at 4096^3 takes 0.4 million steps for enclosure(), and 3.6 and
// 1.4 million for the two passes of the search.
constexpr uint64_t kMaxEnclosureSteps = uint64_t{1} << 22;
constexpr uint64_t kMaxSearchSteps = uint64_t{1} << 25;  // for each of the two passes
constexpr uint64_t kMaxBoxCells = uint64_t{1} << 25;

// Casts rays until they have taken `max_steps` steps in total. If used_up() is true, it is possible
// that the last ray ended before its hit, and results that depend on this ray must be discarded.
class LimitedRays {
 public:
  LimitedRays(const DagView& dag, uint64_t max_steps, const CancelToken& cancel)
      : caster_(dag), cancel_(cancel), steps_left_(max_steps) {}

  bool cast(const Ray& ray, const Cone& cone, double t_min, double t_max, Hit& hit) {
    if (++count_ % 16 == 0) cancel_.check();
    return caster_.cast(ray, cone, t_min, t_max, hit, steps_left_);
  }
  bool used_up() const { return steps_left_ == 0; }

 private:
  const RayCaster caster_;
  const CancelToken& cancel_;
  uint64_t steps_left_, count_ = 0;
};

// Returns a measure of how enclosed the scene is. Casts rays from up to 1000 places on the surface
// to 26 directions, and takes the longest free distance at each place. A place from which a ray
// leaves the scene counts as 0. The result is the mean of these distances, as a share of the
// scene's diagonal. The result is near 0 for an object or for caves, and larger for interiors.
double enclosure(const DagView& dag, const OccupiedCells& cells, const Box& box,
                 const CancelToken& cancel) {
  constexpr size_t kPlaces = 1000;
  // The stride is coprime to kPlaces. So the places visited first are spread over the scene, even
  // if the steps are used up before all places are visited.
  constexpr size_t kStride = 381;
  LimitedRays rays(dag, kMaxEnclosureSteps, cancel);
  std::vector<Vec> directions;  // toward the 26 neighbors of a cell
  for (int i = 0; i < 27; ++i)
    if (i != 13) directions.push_back(normalized({{i / 9 - 1.0, i / 3 % 3 - 1.0, i % 3 - 1.0}}));
  const std::vector<Vec>& points = cells.centers;
  const double start = 3 * cells.edge;
  const double width = std::max(1.0, finest_width(dag));
  double sum = 0;
  size_t places = 0;
  for (; places < kPlaces; ++places) {
    const Vec& place = points[places * kStride % kPlaces * points.size() / kPlaces];
    double longest = 0;
    for (const Vec& direction : directions) {
      Hit hit;
      const bool escaped = !rays.cast({place, direction}, {width, 0}, start, box.diagonal(), hit);
      longest = escaped ? 0 : std::max(longest, hit.t);
      if (escaped) break;
    }
    if (rays.used_up()) break;
    sum += longest;
  }
  return places == 0 ? 0 : sum / (static_cast<double>(places) * box.diagonal());
}

// Rates a view with kColumns * kRows rays of the width `width`. The score is higher for long views
// with much detail. It is lower if the camera is close to a wall or looks out of the scene. A
// distance below `near` counts as close to a wall.
template <int kColumns, int kRows>
double score(LimitedRays& rays, const Placement& placement, double width, double near) {
  constexpr double kRays = kColumns * kRows;
  const Camera camera(placement, kColumns, kRows);
  double depth[kRows][kColumns], sum = 0;
  int close = 0, out = 0, breaks = 0;
  // True if three neighbor pixels with the depths a, b and c are not on one plane. Along a plane,
  // the inverse of the depth is linear.
  const auto bends = [](double a, double b, double c) {
    return std::fabs(1 / a - 2 / b + 1 / c) * b > 0.03;
  };
  for (int y = 0; y < kRows; ++y)
    for (int x = 0; x < kColumns; ++x) {
      Hit hit;
      const bool seen =
          rays.cast(camera.ray(x + 0.5, y + 0.5), {width, camera.pixel_spread()}, 0, kFar, hit);
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

struct Trials {
  std::vector<Placement> placements;
  std::vector<double> scores;
};
// Returns views from 400 random places in the lower half of the scene, in eight directions each,
// and their rough scores. Returns fewer views if the steps are used up.
Trials rough_trials(const DagView& dag, const Box& box, double fov_degrees,
                    const CancelToken& cancel) {
  constexpr uint64_t kPlaces = 400;
  constexpr int kYaws = 8;
  const Sampler sampler(2);
  const Vec extent = box.high - box.low;
  LimitedRays rays(dag, kMaxSearchSteps, cancel);
  Trials trials;
  for (uint64_t i = 0; i < kPlaces; ++i) {
    const Sampler::Pair across = sampler.pair(2 * i), up = sampler.pair(2 * i + 1);
    const Vec eye =
        box.low + Vec{{extent[0] * (0.05 + 0.9 * across.u), extent[1] * (0.05 + 0.35 * up.u),
                       extent[2] * (0.05 + 0.9 * across.v)}};
    for (int yaw = 0; yaw < kYaws; ++yaw) {
      const double angle = 2 * kPi * (yaw + up.v) / kYaws;
      const Vec forward{{std::cos(angle), 0.08, std::sin(angle)}};
      const Placement trial{eye, eye + forward * (0.25 * box.diagonal()), fov_degrees};
      const double rough = score<12, 7>(rays, trial, finest_width(dag), 0.04 * box.diagonal());
      if (rays.used_up()) return trials;
      trials.placements.push_back(trial);
      trials.scores.push_back(rough);
    }
  }
  return trials;
}

// Returns the best of some random views; nullopt if the steps were used up before a view was rated.
// To save time, all views are rated roughly first, with a quarter of the rays. Only views with good
// rough scores are rated again with all rays.
std::optional<Placement> inside_view(const DagView& dag, const Box& box, double fov_degrees,
                                     const CancelToken& cancel) {
  // Views with less than this share of the best rough score are not rated again.
  constexpr double kRoughShare = 0.6;
  const auto [trials, rough] = rough_trials(dag, box, fov_degrees, cancel);
  if (trials.empty()) return std::nullopt;
  const size_t first =
      static_cast<size_t>(std::max_element(rough.begin(), rough.end()) - rough.begin());
  LimitedRays rays(dag, kMaxSearchSteps, cancel);
  Placement best{box.center(), box.center() + Vec{{1, 0, 0}}, fov_degrees};
  double best_score = 0;
  for (size_t i = 0; i < trials.size() && !rays.used_up(); ++i) {
    if (rough[i] < kRoughShare * rough[first]) continue;
    const double trial_score =
        score<24, 14>(rays, trials[i], finest_width(dag), 0.04 * box.diagonal());
    if (trial_score <= best_score || rays.used_up()) continue;
    best_score = trial_score;
    best = trials[i];
  }
  return rays.used_up() && best_score == 0 ? trials[first] : best;
}

}  // namespace

std::array<double, 3> world_point(const Vec& point, const voxdag_reader::File& file) {
  const double voxel = file.edge() / static_cast<double>(file.resolution());
  std::array<double, 3> world{};
  for (int axis = 0; axis < 3; ++axis)
    world[static_cast<size_t>(axis)] = file.origin()[axis] + point[axis] * voxel;
  return world;
}

Box occupied_box(const DagView& dag, const CancelToken& cancel) {
  Box box{{{1e30, 1e30, 1e30}}, {}};
  uint64_t cells = 0;
  const auto add = [&](const DagView::Cell& cell) {
    for (int axis = 0; axis < 3; ++axis) {
      box.low[axis] = std::min(box.low[axis], cell.low[axis]);
      box.high[axis] = std::max(box.high[axis], cell.low[axis] + cell.edge);
    }
  };
  const auto reaches_out = [&](const DagView::Cell& cell) {
    if (++cells % 4096 == 0) cancel.check();
    for (int axis = 0; axis < 3; ++axis) {
      if (cell.low[axis] >= box.low[axis] && cell.low[axis] + cell.edge <= box.high[axis]) continue;
      if (cells < kMaxBoxCells) return 0xffu;
      add(cell);  // the cell is not divided
      break;
    }
    return 0u;
  };
  dag.for_each_cell(std::min(dag.grid_levels(), 11u), reaches_out, add);
  return box;
}

std::vector<Vec> OccupiedCells::outline() const {
  if (centers.size() >= kFewCells) return centers;
  std::vector<Vec> corners;
  for (const Vec& center : centers)
    for (int corner = 0; corner < 8; ++corner) {
      Vec offset;
      for (int axis = 0; axis < 3; ++axis) offset[axis] = corner >> axis & 1 ? 0.5 : -0.5;
      corners.push_back(center + offset * edge);
    }
  return corners;
}

OccupiedCells occupied_cells(const DagView& dag) {
  const auto everywhere = [](const DagView::Cell&) { return 0xffu; };
  OccupiedCells cells;
  for (uint32_t level = std::min(dag.grid_levels(), 6u);; ++level) {
    cells = {{}, static_cast<double>(dag.resolution() >> level)};
    const Vec half{{cells.edge / 2, cells.edge / 2, cells.edge / 2}};
    dag.for_each_cell(level, everywhere,
                      [&](const DagView::Cell& cell) { cells.centers.push_back(cell.low + half); });
    if (cells.centers.size() >= kFewCells || level == dag.grid_levels()) return cells;
  }
}

const std::vector<std::string>& view_names() {
  static const std::vector<std::string> names = {"auto", "iso",   "front", "back",
                                                 "left", "right", "top",   "inside"};
  return names;
}

const Box& NamedViews::box() {
  if (!box_) box_ = occupied_box(dag_, cancel_);
  return *box_;
}

const OccupiedCells& NamedViews::cells() {
  if (!cells_) cells_ = occupied_cells(dag_);
  return *cells_;
}

Placement NamedViews::find(const std::string& name, double aspect,
                           std::optional<double> fov_degrees) {
  const bool automatic = name == "auto";
  std::string direction = name;
  if (name == "inside" || automatic) {
    if (!automatic || enclosure(dag_, cells(), box(), cancel_) > kMinEnclosureOfRooms) {
      const auto found = inside_view(dag_, box(), fov_degrees.value_or(kInsideFov), cancel_);
      if (found) return *found;
    }
    direction = "iso";
  }
  for (const NamedDirection& d : kDirections)
    if (direction == d.name)
      return fit_camera(cells().outline(), d.toward_eye, fov_degrees.value_or(kOutsideFov), aspect);
  std::string names;
  for (const std::string& known : view_names()) names += (names.empty() ? "" : ", ") + known;
  throw Error(ErrorCode::kInvalidInput, "view '" + name + "': expected one of " + names);
}

Placement named_view(const std::string& name, const DagView& dag, double aspect,
                     std::optional<double> fov_degrees, const CancelToken& cancel) {
  return NamedViews(dag, cancel).find(name, aspect, fov_degrees);
}

}  // namespace voxdag::query
