#include "query/render/g_buffer.h"

#include <algorithm>

namespace voxdag::query {

GBufferPixel GBuffer::smoothed(int x, int y, double pixel_spread) {
  constexpr int kReach = 4;  // pixels on each side
  // Maximum distance of a neighbor from the plane of the pixel's surface, in pixel widths.
  constexpr double kPlaneSlack = 3;
  GBufferPixel pixel = at(x, y);
  const bool on_surface = pixel.coverage > 0;
  const Vec normal = pixel.normal, offset = pixel.offset;
  const double slack = kPlaneSlack * pixel_spread * length(offset);
  double weights = 0, near_weights = 0, floor = 0, sun = 0;
  Vec sky, near_normal;
  for (int v = std::max(0, y - kReach); v <= std::min(height - 1, y + kReach); ++v)
    for (int u = std::max(0, x - kReach); u <= std::min(width - 1, x + kReach); ++u) {
      const GBufferPixel& other = at(u, v);
      if ((other.coverage > 0) != on_surface) continue;
      const int squared_distance = (u - x) * (u - x) + (v - y) * (v - y);
      const double near = std::exp(-squared_distance / (0.4 * kReach * kReach));
      double weight = near;
      if (on_surface) {
        const double alike = std::max(0.0, dot(normal, other.normal));
        const double off = std::fabs(dot(normal, other.offset - offset));
        weight *= alike * alike * alike * alike * std::max(0.0, 1 - off / slack);
      }
      weights += weight;
      floor += weight * other.floor;
      sky = sky + other.sky * weight;
      weight *= near * near * near * near * near;
      near_weights += weight;
      sun += weight * other.sun;
      near_normal = near_normal + other.normal * weight;
    }
  if (!(near_weights > 0)) return pixel;
  if (!on_surface) {
    pixel.floor = static_cast<float>(floor / weights);
    return pixel;
  }
  pixel.sky = sky * (1 / weights);
  pixel.sun = static_cast<float>(sun / near_weights);
  pixel.normal = normalized(near_normal);
  return pixel;
}

}  // namespace voxdag::query
