#include "query/render/views.h"

#include <algorithm>

#include "core/base/error.h"
#include "query/render/sampling.h"

namespace voxdag::query {
namespace {

constexpr double kFar = 1e30;
constexpr double kOutsideFov = 32, kInsideFov = 62;
constexpr double kEnclosureOfRooms = 0.1;

struct NamedDirection {
  const char* name;
  Vec toward_eye;
};
// glTF's front looks along +z; "iso" stands to its right, above it.
const NamedDirection kDirections[] = {
    {"iso", {{0.62, 0.55, 1}}}, {"front", {{0, 0, 1}}}, {"back", {{0, 0, -1}}},
    {"left", {{-1, 0, 0}}},     {"right", {{1, 0, 0}}}, {"top", {{0, 1, 0}}},
};

// A random occupied cell: its middle and its edge. At each level a child is chosen by how many
// children it has, which comes close to choosing all cells alike.
Vec random_cell(const DagView& dag, Sampler& sampler, double& size) {
  const uint32_t depth = std::min(dag.grid_levels() - 1, 11u);
  uint64_t content = dag.root();
  Vec low;
  size = static_cast<double>(dag.resolution());
  for (uint32_t d = 0; d < depth; ++d) {
    const DagView::Children children = dag.children(d, content);
    int weights[8] = {}, sum = 0;
    for (int i = 0; i < 8; ++i)
      if (children.has(i))
        sum += weights[i] = kPopcount8[dag.children(d + 1, dag.content(d, children, i)).mask];
    auto left = static_cast<int>(sampler.pair().u * sum);
    int index = 0;
    while (left >= weights[index]) left -= weights[index++];
    content = dag.content(d, children, index);
    size /= 2;
    low = low + Vec{{index & 4 ? size : 0, index & 2 ? size : 0, index & 1 ? size : 0}};
  }
  return low + Vec{{size / 2, size / 2, size / 2}};
}

// A glance through a camera: few rays, judged for how much there is to see.
class Glance {
 public:
  Glance(const RayCaster& caster, const Placement& placement) {
    const Camera camera(placement, kColumns, kRows);
    for (int y = 0; y < kRows; ++y)
      for (int x = 0; x < kColumns; ++x) {
        Hit hit;
        const bool seen =
            caster.cast(camera.ray(x + 0.5, y + 0.5), {0, camera.pixel_spread()}, 0, kFar, hit);
        depth_[y][x] = seen ? std::max(hit.t, 1.0) : kFar;
      }
  }

  // The share of rays at which what is seen is not one plane: little for a wall or a box.
  double detail() const {
    int breaks = 0;
    for (int y = 0; y < kRows; ++y)
      for (int x = 0; x < kColumns; ++x) {
        if (x > 1) breaks += bends(depth_[y][x - 2], depth_[y][x - 1], depth_[y][x]);
        if (y > 1) breaks += bends(depth_[y - 2][x], depth_[y - 1][x], depth_[y][x]);
      }
    return breaks / kRays;
  }

  // Higher for long views with much in them; lower for a wall before one's nose, or where one looks
  // out of the scene. `near` is a distance that is too close.
  double score(double near) const {
    int close = 0, out = 0;
    double sum = 0;
    for (int y = 0; y < kRows; ++y)
      for (int x = 0; x < kColumns; ++x) {
        const double depth = depth_[y][x];
        close += depth < near;
        out += depth == kFar;
        sum += depth == kFar ? 0 : depth;
      }
    const double free = 1 - close / kRays, within = 1 - out / kRays;
    return detail() * std::sqrt(sum / kRays) * free * free * free * within;
  }

 private:
  static constexpr int kColumns = 24, kRows = 14;
  static constexpr double kRays = kColumns * kRows;

  // Whether three neighboring rays do not end on one plane, along which 1/depth is linear.
  static bool bends(double a, double b, double c) {
    return std::fabs(1 / a - 2 / b + 1 / c) * b > 0.03;
  }

  double depth_[kRows][kColumns];
};

}  // namespace
const std::vector<std::string>& view_names() {
  static const std::vector<std::string> names = {"auto", "iso",   "front", "back",
                                                 "left", "right", "top",   "inside"};
  return names;
}

Placement named_view(const std::string& name, const RayCaster& caster, const DagView& dag,
                     const Box& box, double aspect, std::optional<double> fov_degrees) {
  if (name == "auto") {
    const bool room = enclosure(caster, dag, box) > kEnclosureOfRooms;
    return named_view(room ? "inside" : "iso", caster, dag, box, aspect, fov_degrees);
  }
  if (name == "inside") return inside_view(caster, box, fov_degrees.value_or(kInsideFov));
  for (const NamedDirection& d : kDirections)
    if (name == d.name)
      return see_whole(without_strays(occupied_points(dag)), d.toward_eye,
                       fov_degrees.value_or(kOutsideFov), aspect);
  std::string names;
  for (const std::string& known : view_names()) names += (names.empty() ? "" : ", ") + known;
  throw Error(ErrorCode::kInvalidInput, "no view is called \"" + name + "\": expected " + names);
}

double enclosure(const RayCaster& caster, const DagView& dag, const Box& box) {
  constexpr int kPlaces = 1000, kRays = 24;
  Sampler sampler(1);
  double sum = 0;
  for (int i = 0; i < kPlaces; ++i) {
    double size = 0, longest = 0;
    const Vec place = random_cell(dag, sampler, size);
    for (int j = 0; j < kRays; ++j) {
      Hit hit;
      const Ray ray{place, uniform_direction(sampler.pair())};
      const bool escaped = !caster.cast(ray, {size, 0}, 3 * size, box.diagonal(), hit);
      longest = escaped ? 0 : std::max(longest, hit.t);
      if (escaped) break;
    }
    sum += longest;
  }
  return sum / (kPlaces * box.diagonal());
}

Placement inside_view(const RayCaster& caster, const Box& box, double fov_degrees) {
  constexpr int kPlaces = 400, kYaws = 8;
  Sampler sampler(2);
  const Vec extent = box.high - box.low;
  Placement best{box.center(), box.center() + Vec{{1, 0, 0}}, fov_degrees};
  double best_score = 0;
  for (int i = 0; i < kPlaces; ++i) {
    const Sampler::Pair across = sampler.pair(), up = sampler.pair();
    const Vec eye =
        box.low + Vec{{extent[0] * (0.05 + 0.9 * across.u), extent[1] * (0.05 + 0.35 * up.u),
                       extent[2] * (0.05 + 0.9 * across.v)}};
    for (int yaw = 0; yaw < kYaws; ++yaw) {
      const double angle = 2 * kPi * (yaw + up.v) / kYaws;
      const Vec forward{{std::cos(angle), 0.08, std::sin(angle)}};
      const Placement trial{eye, eye + forward * (0.25 * box.diagonal()), fov_degrees};
      const double score = Glance(caster, trial).score(0.04 * box.diagonal());
      if (score <= best_score) continue;
      best_score = score;
      best = trial;
    }
  }
  return best;
}

}  // namespace voxdag::query
