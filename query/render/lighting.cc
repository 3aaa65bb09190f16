#include "query/render/lighting.h"

#include <algorithm>

namespace voxdag::query {
namespace {

constexpr Vec kZenith{{0.62, 0.78, 1.00}}, kHorizon{{0.95, 0.98, 1.02}};
constexpr Vec kGround{{0.40, 0.36, 0.31}};
constexpr double kLampRadius = 0.006;  // at distance 1
constexpr double kBounce = 0.42;       // of the sky's light, from what hides it
constexpr double kRayWidening = 0.1;   // of rays to the sky

Vec sky(const Vec& direction) {
  const double up = direction[1];
  return up >= 0 ? mix(kHorizon, kZenith, std::sqrt(up)) : mix(kHorizon, kGround, std::sqrt(-up));
}

bool inside(const Box& box, const Vec& p) {
  for (int axis = 0; axis < 3; ++axis)
    if (p[axis] < box.low[axis] || p[axis] > box.high[axis]) return false;
  return true;
}

double median_distance(const std::vector<Surface>& seen) {
  std::vector<double> distances;
  for (const Surface& s : seen) distances.push_back(s.t);
  const auto middle = distances.begin() + static_cast<ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

}  // namespace

Lighting::Lighting(const DagView& dag, const Box& box, const Camera& camera,
                   const std::vector<Surface>& seen)
    : caster_(dag), box_(box), pixel_spread_(camera.pixel_spread()) {
  if (seen.empty()) return;
  has_floor_ = camera.eye()[1] > box.low[1] && !inside(box, camera.eye());
  sky_reach_ = (has_floor_ ? 0.35 : 1.0) * median_distance(seen);
  place_sun(seen, camera.forward() * -1.0);
  if (!has_floor_ && lit_ < 0.03) place_lamp(camera.eye(), camera.forward() * -1.0);
}

Vec Lighting::skylight(const Surface& s, int rays, Sampler& sampler) const {
  Vec sum;
  for (int i = 0; i < rays; ++i) {
    const Vec direction = cosine_direction(s.normal, sampler.pair(i, rays));
    Hit hit;
    double open = 1;
    if (caster_.cast({s.start, direction}, {s.size, kRayWidening}, 0, sky_reach_, hit)) {
      const double near = hit.t / sky_reach_;
      open = kBounce * std::sqrt(near) * (1 - near) + near * near * near;
    }
    sum = sum + sky(direction) * open;
  }
  sampler.next_question();
  return sum * (1.0 / rays);
}

double Lighting::lamplight(const Surface& s, Sampler& sampler) const {
  const Vec toward = lamp_ - s.start;
  const double distance = length(toward);
  const Sampler::Pair p = sampler.pair();
  if (dot(s.normal, toward) <= 0) return 0;
  Vec u, w;
  basis_around(toward * (1 / distance), u, w);
  const double r = kLampRadius * distance * std::sqrt(p.u), angle = 2 * kPi * p.v;
  const Vec part = lamp_ + u * (r * std::cos(angle)) + w * (r * std::sin(angle));
  if (!sees_lamp(s.start, s.size, part)) return 0;
  return 1 / (1 + distance * distance / (lamp_reach_ * lamp_reach_));
}

double Lighting::facing_lamp(const Vec& place, const Vec& normal) const {
  const Vec toward = lamp_ - place;
  return std::max(0.0, dot(normal, toward) / length(toward));
}

bool Lighting::sees_lamp(const Vec& from, double size, const Vec& lamp) const {
  constexpr double kWidening = 0.004;
  const double distance = length(lamp - from);
  Hit hit;
  return !caster_.cast({from, (lamp - from) * (1 / distance)}, {size, kWidening}, 0, distance, hit);
}

double Lighting::floor_light(const Ray& ray, Sampler& sampler) const {
  if (!has_floor_ || ray.direction[1] >= 0) return 1;
  const double t = (box_.low[1] - ray.origin[1]) / ray.direction[1];
  const Vec p = ray.at(t);
  const double from_middle = length(p - box_.center()) / box_.diagonal();
  const double fade = std::exp(-1.6 * from_middle * from_middle);
  if (fade < 0.01) return 1;
  constexpr int kRays = 4;
  const double size = 0.5 * pixel_spread_ * t, reach = 0.5 * box_.diagonal();
  double open = 0;
  for (int i = 0; i < kRays; ++i) {
    const Vec d = cosine_direction({{0, 1, 0}}, sampler.pair(i, kRays));
    Hit hit;
    const bool hidden = caster_.cast({p, d}, {size, kRayWidening}, 0, reach, hit);
    open += (hidden ? hit.t / reach : 1) / kRays;
  }
  sampler.next_question();
  const double lit = sees_lamp(p, size, lamp_) ? 1 : 0;
  return 1 - fade * (1 - (0.25 + 0.35 * open + 0.40 * lit));
}

double Lighting::lit_share(const std::vector<Surface>& seen, const Vec& lamp) const {
  int lit = 0;
  for (const Surface& s : seen)
    if (dot(s.normal, lamp - s.start) > 0 && sees_lamp(s.start, s.size, lamp)) ++lit;
  return static_cast<double>(lit) / static_cast<double>(seen.size());
}

// Over the left shoulder of a camera that looks on from outside. Within a scene, of suns all around
// at three heights, the one that lights about a third of what is seen.
void Lighting::place_sun(const std::vector<Surface>& seen, const Vec& back) {
  constexpr int kTurns = 16, kHeights = 3;
  constexpr double kWanted = 0.35;
  const double behind = std::atan2(back[2], back[0]), far = 1000 * box_.diagonal();
  lamp_reach_ = 1e6 * far;
  lit_ = 1e9;
  for (int i = 0; i < (has_floor_ ? 1 : kTurns * kHeights); ++i) {
    const double turn = behind + 0.9 - 2 * kPi * (i % kTurns) / kTurns;
    const double height = 0.65 + 0.25 * (i / kTurns);
    const Vec toward{
        {std::cos(turn) * std::cos(height), std::sin(height), std::sin(turn) * std::cos(height)}};
    const double lit = lit_share(seen, toward * far);
    if (std::fabs(lit - kWanted) >= std::fabs(lit_ - kWanted)) continue;
    lit_ = lit;
    lamp_ = toward * far;
  }
}

// Beside the camera and above it, half way to what is there.
void Lighting::place_lamp(const Vec& eye, const Vec& back) {
  const Vec aside = normalized({{back[2], 0.8, -back[0]}});
  double room = 0.3 * sky_reach_;
  Hit hit;
  if (caster_.cast({eye, aside}, {}, 0, 2 * room, hit)) room = hit.t / 2;
  lamp_ = eye + aside * room;
  lamp_reach_ = sky_reach_;
}

}  // namespace voxdag::query
