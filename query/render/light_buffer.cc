#include "query/render/light_buffer.h"

#include <algorithm>

namespace voxdag::query {
namespace {

constexpr int kReach = 4;  // pixels on each side

Vec normal_of(const LightPixel& p) { return {{p.normal[0], p.normal[1], p.normal[2]}}; }

// The middle of what a pixel shows.
Vec place_of(const LightPixel& p, const Camera& camera, int x, int y) {
  return camera.ray(x + 0.5, y + 0.5).at(p.t);
}

double nearness(int dx, int dy) { return std::exp(-(dx * dx + dy * dy) / (0.4 * kReach * kReach)); }

}  // namespace

LightPixel LightBuffer::smoothed(const Camera& camera, int x, int y) const {
  const LightPixel& pixel = at(x, y);
  const bool on_surface = pixel.coverage > 0;
  const Vec normal = normal_of(pixel);
  const Vec place = place_of(pixel, camera, x, y);
  // How far off the plane a neighbor may lie.
  const double slack = 3 * pixel.t * camera.pixel_spread();
  double weights = 0, floor = 0, near_weights = 0, lamp = 0;
  Vec sky, near_normal;
  for (int v = std::max(0, y - kReach); v <= std::min(height_ - 1, y + kReach); ++v)
    for (int u = std::max(0, x - kReach); u <= std::min(width_ - 1, x + kReach); ++u) {
      const LightPixel& other = at(u, v);
      if ((other.coverage > 0) != on_surface) continue;
      const double near = nearness(u - x, v - y);
      double weight = near;
      if (on_surface) {
        const double alike = std::max(0.0, dot(normal, normal_of(other)));
        const double off = std::fabs(dot(normal, place_of(other, camera, u, v) - place));
        weight *= alike * alike * alike * alike * std::max(0.0, 1 - off / slack);
      }
      weights += weight;
      floor += weight * other.floor;
      sky = sky + Vec{{other.sky[0], other.sky[1], other.sky[2]}} * weight;
      weight *= near * near * near * near * near;
      near_weights += weight;
      lamp += weight * other.lamp;
      near_normal = near_normal + normal_of(other) * weight;
    }
  LightPixel result = pixel;
  if (!(weights > 0)) return result;
  if (!on_surface) result.floor = static_cast<float>(floor / weights);
  for (int c = 0; c < 3; ++c) result.sky[c] = static_cast<float>(sky[c] / weights);
  if (!on_surface || !(near_weights > 0)) return result;
  result.lamp = static_cast<float>(lamp / near_weights);
  near_normal = normalized(near_normal);
  for (int c = 0; c < 3; ++c) result.normal[c] = static_cast<float>(near_normal[c]);
  return result;
}

}  // namespace voxdag::query
