#include "cli/render/shader.h"

#include <algorithm>
#include <vector>

#include "cli/render/surface.h"

namespace voxdag::render {
namespace {

constexpr double kFar = 1e30;
constexpr Vec kAlbedo{{0.74, 0.70, 0.64}};
constexpr Vec kLamplight{{3.6, 3.2, 2.6}};
constexpr Vec kZenith{{0.62, 0.78, 1.00}}, kHorizon{{0.95, 0.98, 1.02}},
    kGround{{0.40, 0.36, 0.31}};
constexpr Vec kTopColour{{0.46, 0.54, 0.65}}, kBottomColour{{0.86, 0.87, 0.88}};
constexpr double kLampRadius = 0.012;
constexpr double kBounce = 0.42;      // of the sky's light, from what hides it
constexpr double kRayWidening = 0.1;  // of rays to the light
constexpr int kSkyRays = 6;           // for one sample of a pixel

Vec product(const Vec& a, const Vec& b) { return {{a[0] * b[0], a[1] * b[1], a[2] * b[2]}}; }

double luminance(const Vec& c) { return 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]; }

Vec sky(const Vec& direction) {
  const double up = direction[1];
  return up >= 0 ? mix(kHorizon, kZenith, std::sqrt(up)) : mix(kHorizon, kGround, std::sqrt(-up));
}

// A photographic film's curve (Narkowicz 2015): steep in the middle, bright light compressed.
Vec tone(const Vec& light) {
  Vec out;
  for (int i = 0; i < 3; ++i) {
    const double x = light[i];
    out[i] = std::min(1.0, x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14));
  }
  return out;
}

bool inside(const Box& box, const Vec& p) {
  for (int axis = 0; axis < 3; ++axis)
    if (p[axis] < box.low[axis] || p[axis] > box.high[axis]) return false;
  return true;
}

}  // namespace

Shader::Shader(const DagView& dag, const Box& box, const Camera& camera, int width, int height)
    : dag_(dag), caster_(dag), camera_(camera), box_(box), height_(height) {
  std::vector<Surface> seen;
  std::vector<double> distances;
  constexpr int kColumns = 40, kRows = 24;
  for (int i = 0; i < kColumns * kRows; ++i) {
    Surface s;
    const double x = (i % kColumns + 0.5) * width / kColumns;
    const double y = (i / kColumns + 0.5) * height / kRows;
    if (!hit_surface(camera.ray(x, y), s)) continue;
    seen.push_back(s);
    distances.push_back(s.t);
  }
  const Vec eye = camera.ray(0, 0).origin;
  has_floor_ = eye[1] > box.low[1] && !inside(box, eye);
  if (seen.empty()) return;
  std::sort(distances.begin(), distances.end());
  reach_ = (has_floor_ ? 0.35 : 1.0) * distances[distances.size() / 2];
  haze_start_ = distances.front();
  haze_depth_ = std::max(box.diagonal(), 1.0);
  choose_lamp(seen);
  choose_exposure(seen);
}

bool Shader::hit_surface(const Ray& ray, Surface& s) const {
  Hit hit;
  const Cone pixel{0, camera_.pixel_spread() * 0.75};
  if (!caster_.cast(ray, pixel, 0, kFar, hit)) return false;
  s.t = hit.t;
  s.size = static_cast<double>(dag_.resolution() >> hit.depth);
  // Voxels of many pixels are shown as the cubes they are; smaller ones as the surface they sample.
  const double pixels = s.size / std::max(hit.t * camera_.pixel_spread(), 1e-9);
  const double cube = std::clamp((pixels - 5) / 8, 0.0, 1.0);
  const Vec face = face_normal(hit, ray.direction);
  s.normal =
      cube < 1 ? normalized(mix(surface_normal(dag_, hit, ray.direction), face, cube)) : face;
  s.point = ray.at(hit.t) + s.normal * (s.size * 2.2 * (1 - cube)) + face * (s.size * 0.01);
  // In a narrow place that may lie in something else. Where the ray came through is free.
  if (caster_.cast({s.point, s.normal}, {s.size, 0}, 0, 0, hit))
    s.point = ray.at(s.t - 1.5 * s.size);
  return true;
}

Vec Shader::colour(double x, double y, Sampler& sampler) const {
  const Ray ray = camera_.ray(x, y);
  const Vec behind = background(y);
  Surface s;
  if (!hit_surface(ray, s)) return behind * floor_light(ray, kFar, sampler);
  const Vec light = tone(lit_surface(s, kSkyRays, sampler) * exposure_);
  const double depth = std::max(0.0, (s.t - haze_start_) / haze_depth_);
  return mix(light, behind, 0.25 * (1 - std::exp(-depth * depth)));
}

Vec Shader::lit_surface(const Surface& s, int sky_rays, Sampler& sampler) const {
  return product(kAlbedo, skylight(s, sky_rays, sampler) + lamplight(s, sampler));
}

Vec Shader::skylight(const Surface& s, int rays, Sampler& sampler) const {
  const Cone cone{s.size, kRayWidening};
  Vec sum;
  for (int i = 0; i < rays; ++i) {
    const Vec direction = cosine_direction(
        s.normal, sampler.pair(static_cast<uint64_t>(i), static_cast<uint64_t>(rays)));
    Hit hit;
    double open = 1;
    if (caster_.cast({s.point, direction}, cone, 0, reach_, hit)) {
      const double near = hit.t / reach_;
      open = kBounce * std::sqrt(near) * (1 - near) + near * near * near;
    }
    sum = sum + sky(direction) * open;
  }
  sampler.next_pair();
  return sum * (1.0 / rays);
}

Vec Shader::lamplight(const Surface& s, Sampler& sampler) const {
  const Vec towards = lamp_ - s.point;
  const double distance = length(towards), facing = dot(s.normal, towards) / distance;
  const Sampler::Pair p = sampler.pair();
  if (facing <= 0) return {};
  Vec u, w;
  basis_around(towards * (1 / distance), u, w);
  const double r = kLampRadius * distance * std::sqrt(p.u), angle = 2 * kPi * p.v;
  if (!sees_lamp(s, lamp_ + u * (r * std::cos(angle)) + w * (r * std::sin(angle)))) return {};
  return kLamplight * (facing / (1 + distance * distance / (lamp_reach_ * lamp_reach_)));
}

bool Shader::sees_lamp(const Surface& s, const Vec& lamp) const {
  const double distance = length(lamp - s.point);
  Hit hit;
  return !caster_.cast({s.point, (lamp - s.point) * (1 / distance)}, {s.size, 0.004}, 0, distance,
                       hit);
}

Vec Shader::background(double y) const {
  return mix(kTopColour, kBottomColour, std::clamp(y / height_, 0.0, 1.0));
}

double Shader::floor_light(const Ray& ray, double until, Sampler& sampler) const {
  if (!has_floor_ || ray.direction[1] >= 0) return 1;
  const double t = (box_.low[1] - ray.origin[1]) / ray.direction[1];
  if (t > until) return 1;
  const Vec p = ray.at(t);
  const double from_middle = length(p - box_.centre()) / box_.diagonal();
  const double fade = std::exp(-1.6 * from_middle * from_middle);
  if (fade < 0.01) return 1;
  Surface s{p, {{0, 1, 0}}, 0.5 * camera_.pixel_spread() * t, t};
  Hit hit;
  double open = 0;
  for (int i = 0; i < 4; ++i) {
    const Vec d = cosine_direction(s.normal, sampler.pair(static_cast<uint64_t>(i), 4));
    if (!caster_.cast({p, d}, {s.size, kRayWidening}, 0, 0.5 * box_.diagonal(), hit))
      open += 0.25;
    else
      open += 0.25 * std::min(1.0, hit.t / (0.5 * box_.diagonal()));
  }
  sampler.next_pair();
  const double lit = sees_lamp(s, lamp_) ? 1 : 0;
  return 1 - fade * (1 - (0.25 + 0.35 * open + 0.40 * lit));
}

double Shader::lit_share(const std::vector<Surface>& seen, const Vec& lamp) const {
  int lit = 0;
  for (const Surface& s : seen)
    if (dot(s.normal, lamp - s.point) > 0 && sees_lamp(s, lamp)) ++lit;
  return static_cast<double>(lit) / static_cast<double>(seen.size());
}

// A sun over the camera's left shoulder. Within a scene, of suns all around at three heights one
// that lights about a third of what is seen; if none gets in, a lamp above and beside the camera.
void Shader::choose_lamp(const std::vector<Surface>& seen) {
  const Vec back = camera_.forward() * -1.0, eye = camera_.ray(0, 0).origin;
  const double behind = std::atan2(back[2], back[0]);
  const double far = 1000 * box_.diagonal();
  constexpr int kTurns = 16, kHeights = 3;
  double best = 0;
  lamp_reach_ = 1e6 * far;
  for (int i = 0; i < (has_floor_ ? 1 : kTurns * kHeights); ++i) {
    const double azimuth = behind + 0.9 - 2 * kPi * (i % kTurns) / kTurns;
    const double height = 0.65 + 0.25 * (i / kTurns);
    const Vec sun = Vec{{std::cos(azimuth) * std::cos(height), std::sin(height),
                         std::sin(azimuth) * std::cos(height)}} *
                    far;
    const double lit = has_floor_ ? 1 : lit_share(seen, sun);
    if (i > 0 && std::fabs(lit - 0.35) >= std::fabs(best - 0.35)) continue;
    best = lit;
    lamp_ = sun;
  }
  if (best > 0.03) return;
  const Vec aside = normalized({{back[2], 0.8, -back[0]}});
  Hit hit;
  double room = 0.3 * reach_;
  if (caster_.cast({eye, aside}, {}, 0, 2 * room, hit)) room = hit.t / 2;
  lamp_ = eye + aside * room;
  lamp_reach_ = reach_;
}

// The middle of what is seen comes out in the middle of the film's curve, its lightest tenth still
// short of white.
void Shader::choose_exposure(const std::vector<Surface>& seen) {
  Sampler sampler(3);
  std::vector<double> light;
  for (const Surface& s : seen) light.push_back(1e-3 + luminance(lit_surface(s, 8, sampler)));
  std::sort(light.begin(), light.end());
  exposure_ = std::min(0.36 / light[light.size() / 2], 0.8 / light[light.size() * 9 / 10]);
}

}  // namespace voxdag::render
