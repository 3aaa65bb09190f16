#include "query/render/lighting.h"

#include <algorithm>

namespace voxdag::query {
namespace {

constexpr double kSkyDistance = 1e30;
constexpr Vec kSunlight{{3.6, 3.2, 2.6}};
constexpr Vec kZenith{{0.62, 0.78, 1.00}}, kHorizon{{0.95, 0.98, 1.02}};
constexpr Vec kGround{{0.40, 0.36, 0.31}};
constexpr double kOpenFloor = 0.82;     // green component of an open sky's light on a floor
constexpr double kSunRadius = 0.006;    // radius of the sun's disk at distance 1
constexpr double kBounce = 0.42;        // share of light that an occluder reflects
constexpr double kSkyWidening = 0.1;    // spread of the cones of rays to the sky
constexpr double kSunWidening = 0.004;  // spread of the cones of rays to the sun

// Dimensions of the Sampler (sampling.h) for rays to the sky and to the sun. The renderer uses
// dimension 0 for the position within the pixel.
constexpr uint64_t kSkyDimension = 1, kSunDimension = 2;

Vec sky_color(const Vec& direction) {
  const double up = direction[1];
  return mix(kHorizon, up >= 0 ? kZenith : kGround, std::sqrt(std::fabs(up)));
}

bool inside(const Box& box, const Vec& p) {
  for (int axis = 0; axis < 3; ++axis)
    if (p[axis] < box.low[axis] || p[axis] > box.high[axis]) return false;
  return true;
}

}  // namespace

Lighting::Lighting(const DagView& dag, const Box& box, const Camera& camera,
                   const std::vector<SurfaceHit>& seen)
    : caster_(dag), box_(box), pixel_spread_(camera.pixel_spread()) {
  if (seen.empty()) return;
  has_floor_ = camera.eye()[1] > box.low[1] && !inside(box, camera.eye());
  sky_reach_ = (has_floor_ ? 0.35 : 1.0) * seen[seen.size() / 2].t;
  place_sun(seen, camera.forward() * -1.0);
}

Vec Lighting::sky_light(const SurfaceHit& s, int rays, const Sampler& sampler) const {
  Vec sum;
  for (int i = 0; i < rays; ++i) {
    const Vec direction = cosine_direction(s.normal, sampler.pair(kSkyDimension, i, rays));
    Hit hit;
    double open = 1;
    if (caster_.cast({s.start, direction}, {s.size, kSkyWidening}, 0, sky_reach_, hit)) {
      const double distance = hit.t / sky_reach_;
      open = kBounce * std::sqrt(distance) * (1 - distance) + distance * distance * distance;
    }
    sum = sum + sky_color(direction) * open;
  }
  return sum * (1.0 / rays);
}

bool Lighting::sees(const SurfaceHit& s, const Vec& sun) const {
  return dot(s.normal, sun) > 0 &&
         !caster_.occluded({s.start, sun}, {s.size, kSunWidening}, 0, kSkyDistance);
}

double Lighting::sun_light(const SurfaceHit& s, const Sampler& sampler) const {
  const Sampler::Pair p = sampler.pair(kSunDimension);
  Vec u, w;
  basis_around(sun_, u, w);
  const double r = kSunRadius * std::sqrt(p.u), angle = 2 * kPi * p.v;
  return sees(s, normalized(sun_ + u * (r * std::cos(angle)) + w * (r * std::sin(angle)))) ? 1 : 0;
}

Vec Lighting::reflected(const Vec& albedo, const Vec& normal, const Vec& sky, double sun) const {
  const Vec light = sky + kSunlight * (sun * std::max(0.0, dot(normal, sun_)));
  return {{albedo[0] * light[0], albedo[1] * light[1], albedo[2] * light[2]}};
}

// Returns the brightness of the floor where `ray` meets it. The shadow on the floor fades with
// distance from the scene.
double Lighting::floor_light(const Ray& ray, const Sampler& sampler) const {
  constexpr int kSkyRays = 4;
  if (!has_floor_ || ray.direction[1] >= 0) return 1;
  SurfaceHit s;
  s.t = (box_.low[1] - ray.origin[1]) / ray.direction[1];
  s.size = 0.5 * pixel_spread_ * s.t;
  s.normal = {{0, 1, 0}};
  s.start = ray.at(s.t);
  const double distance = length(s.start - box_.center()) / length(box_.high - box_.low);
  const double fade = std::exp(-1.6 * distance * distance);
  if (fade < 0.01) return 1;
  const double open = sky_light(s, kSkyRays, sampler)[1] / kOpenFloor;
  return 1 - fade * (0.75 - 0.35 * open - 0.40 * (sees(s, sun_) ? 1 : 0));
}

// Sets the direction of the sun. If there is a floor, places the sun behind the camera's left
// shoulder. (A floor exists only if the camera is outside the scene.) Otherwise, tries 48
// positions: 16 directions around the vertical, each at three heights. Chooses the position where
// the lit share of the samples in `seen` is nearest to kLitTarget.
void Lighting::place_sun(const std::vector<SurfaceHit>& seen, const Vec& back) {
  constexpr int kTurns = 16, kHeights = 3;
  constexpr double kLitTarget = 0.35;
  double best = kSkyDistance;
  for (int i = 0; i < (has_floor_ ? 1 : kTurns * kHeights); ++i) {
    const double turn = std::atan2(back[2], back[0]) + 0.9 - 2 * kPi * (i % kTurns) / kTurns;
    const double height = 0.65 + 0.25 * (i / kTurns);
    const Vec sun{
        {std::cos(turn) * std::cos(height), std::sin(height), std::sin(turn) * std::cos(height)}};
    const auto lit =
        std::count_if(seen.begin(), seen.end(), [&](const SurfaceHit& s) { return sees(s, sun); });
    const double off =
        std::fabs(static_cast<double>(lit) / static_cast<double>(seen.size()) - kLitTarget);
    if (off >= best) continue;
    best = off;
    sun_ = sun;
  }
}

}  // namespace voxdag::query
