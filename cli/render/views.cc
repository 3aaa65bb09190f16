#include "cli/render/views.h"

#include <algorithm>
#include <bit>

#include "cli/render/sampling.h"
#include "core/base/error.h"

namespace voxdag::render {
namespace {

constexpr double kFar = 1e30;
constexpr double kOutsideFov = 32, kInsideFov = 62;
constexpr double kRoomOpenness = 0.16;

struct NamedDirection {
  const char* name;
  Vec towards_eye;
};
// glTF's front looks along +z; "iso" stands to its right, above it.
const NamedDirection kDirections[] = {
    {"iso", {{0.62, 0.55, 1}}}, {"front", {{0, 0, 1}}}, {"back", {{0, 0, -1}}},
    {"left", {{-1, 0, 0}}},     {"right", {{1, 0, 0}}}, {"top", {{0, 1, 0}}},
};

// A random occupied cell: its middle and its edge.
Vec random_cell(const DagView& dag, Sampler& sampler, double& size) {
  const uint32_t depth = std::min(dag.grid_levels(), 11u);
  uint64_t content = dag.root();
  int64_t cell[3] = {0, 0, 0};
  for (uint32_t d = 0; d < depth; ++d) {
    const DagView::Children children = dag.children(d, content);
    auto skip = static_cast<int>(sampler.next() * std::popcount(children.mask));
    int index = 0;
    while (!children.has(index) || skip-- > 0) ++index;
    content = dag.content(d, children, index);
    for (int axis = 0; axis < 3; ++axis) cell[axis] = 2 * cell[axis] + (index >> (2 - axis) & 1);
  }
  size = static_cast<double>(dag.resolution() >> depth);
  Vec middle;
  for (int axis = 0; axis < 3; ++axis)
    middle[axis] = (static_cast<double>(cell[axis]) + 0.5) * size;
  return middle;
}

// How far one sees from a place, level and a little up and down, in kYaws directions.
class Panorama {
 public:
  static constexpr int kYaws = 24;

  Panorama(const RayCaster& caster, const Vec& eye, double limit) : caster_(caster), eye_(eye) {
    cone_.spread = 0.01;
    for (int yaw = 0; yaw < kYaws; ++yaw) {
      double sum = 0;
      for (double rise : {-0.25, -0.05, 0.15, 0.4}) sum += distance(direction(yaw, rise), limit);
      reach_[yaw] = sum / 4;
      nearest_ = std::min(nearest_, reach_[yaw]);
    }
    below_ = distance({{0, -1, 0}}, limit);
    above_ = distance({{0, 1, 0}}, limit);
  }

  static Vec direction(int yaw, double rise) {
    const double angle = 2 * Sampler::kPi * yaw / kYaws;
    return normalized({{std::cos(angle), rise, std::sin(angle)}});
  }
  // The best direction's yaw, and how good it is: how far one sees there, if there is a floor close
  // below and nothing before one's nose; little where the view runs out of the scene.
  double best(int& yaw) const {
    double best = -1;
    for (int y = 0; y < kYaws; ++y) {
      double score = 2 * reach_[y];
      for (int side : {1, 2, kYaws - 2, kYaws - 1}) score += 0.5 * reach_[(y + side) % kYaws];
      if (score > best) {
        best = score;
        yaw = y;
      }
    }
    const double room = std::min(1.0, nearest_ / (0.08 * best));
    const double floor = below_ < 0.5 * above_ || above_ == 0 ? 1.0 : 0.6;
    return below_ > 0 ? best * room * floor : 0;
  }

 private:
  // 0 where the ray leaves the scene.
  double distance(const Vec& direction, double limit) const {
    Hit hit;
    return caster_.cast({eye_, direction}, cone_, 0, kFar, hit) ? std::min(hit.t, limit) : 0;
  }

  const RayCaster& caster_;
  const Vec eye_;
  Cone cone_;
  double reach_[kYaws];
  double nearest_ = kFar;
  double below_ = 0, above_ = 0;
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
    const bool room = openness(caster, dag, box) < kRoomOpenness;
    return named_view(room ? "inside" : "iso", caster, dag, box, aspect, fov_degrees);
  }
  if (name == "inside") return inside_view(caster, box, fov_degrees.value_or(kInsideFov));
  for (const NamedDirection& d : kDirections)
    if (name == d.name)
      return whole_box(box, d.towards_eye, fov_degrees.value_or(kOutsideFov), aspect);
  std::string names;
  for (const std::string& known : view_names()) names += (names.empty() ? "" : ", ") + known;
  throw Error(ErrorCode::kInvalidInput, "no view is called \"" + name + "\": expected " + names);
}

double openness(const RayCaster& caster, const DagView& dag, const Box& box) {
  constexpr int kPlaces = 512, kRays = 8;
  Sampler sampler(1);
  int escaped = 0;
  for (int i = 0; i < kPlaces; ++i) {
    double size = 0;
    const Vec place = random_cell(dag, sampler, size);
    for (int j = 0; j < kRays; ++j) {
      Hit hit;
      const Ray ray{place, sampler.direction()};
      if (!caster.cast(ray, {size, 0}, 3 * size, box.diagonal(), hit)) ++escaped;
    }
  }
  return static_cast<double>(escaped) / (kPlaces * kRays);
}

Placement inside_view(const RayCaster& caster, const Box& box, double fov_degrees) {
  constexpr int kPlaces = 600;
  Sampler sampler(2);
  const Vec extent = box.high - box.low;
  Placement best{box.centre(), box.centre() + Vec{{1, 0, 0}}, fov_degrees};
  double best_score = 0;
  for (int i = 0; i < kPlaces; ++i) {
    Vec eye = box.low;
    eye[0] += extent[0] * (0.08 + 0.84 * sampler.next());
    eye[1] += extent[1] * (0.05 + 0.55 * sampler.next());
    eye[2] += extent[2] * (0.08 + 0.84 * sampler.next());
    int yaw = 0;
    const double score = Panorama(caster, eye, box.diagonal()).best(yaw);
    if (score <= best_score) continue;
    best_score = score;
    best.eye = eye;
    best.target = eye + Panorama::direction(yaw, 0.04) * (0.25 * box.diagonal());
  }
  return best;
}

}  // namespace voxdag::render
