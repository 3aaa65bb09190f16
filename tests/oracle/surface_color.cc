#include "tests/oracle/surface_color.h"

#include <algorithm>
#include <cmath>

namespace oracle {
namespace {

// A point of a triangle: its position relative to the low corner of the cube, and its barycentric
// coordinates.
struct SurfacePoint {
  std::array<double, 3> at{}, shares{};
};
using Polygon = std::vector<SurfacePoint>;

SurfacePoint between(const SurfacePoint& a, const SurfacePoint& b, double part) {
  SurfacePoint out;
  for (size_t i = 0; i < 3; ++i) {
    out.at[i] = a.at[i] + part * (b.at[i] - a.at[i]);
    out.shares[i] = a.shares[i] + part * (b.shares[i] - a.shares[i]);
  }
  return out;
}

// Returns the part of the polygon in which sign * at[axis] <= sign * bound.
Polygon clipped(const Polygon& polygon, size_t axis, double bound, double sign) {
  Polygon out;
  for (size_t i = 0; i < polygon.size(); ++i) {
    const SurfacePoint &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    const double to_a = sign * (bound - a.at[axis]), to_b = sign * (bound - b.at[axis]);
    if (to_a >= 0) out.push_back(a);
    if ((to_a > 0 && to_b < 0) || (to_a < 0 && to_b > 0))
      out.push_back(between(a, b, to_a / (to_a - to_b)));
  }
  return out;
}

Polygon in_cube(const Surface& surface, const Point& low, double edge) {
  Polygon polygon(3);
  for (size_t i = 0; i < 3; ++i) {
    for (size_t a = 0; a < 3; ++a)
      polygon[i].at[a] = static_cast<double>(surface.position[i][a] - low[a]);
    polygon[i].shares[i] = 1;
  }
  for (size_t a = 0; a < 3 && !polygon.empty(); ++a)
    polygon = clipped(clipped(polygon, a, edge, 1), a, 0, -1);
  return polygon;
}

double area_of(const SurfacePoint& a, const SurfacePoint& b, const SurfacePoint& c) {
  std::array<double, 3> u, v;
  for (size_t i = 0; i < 3; ++i) {
    u[i] = b.at[i] - a.at[i];
    v[i] = c.at[i] - a.at[i];
  }
  return 0.5 * std::hypot(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                          u[0] * v[1] - u[1] * v[0]);
}

int bordered(int texel, int size, Border border) {
  if (border == Border::kClamp) return std::clamp(texel, 0, size - 1);
  const int period = border == Border::kRepeat ? size : 2 * size;
  const int in_period = (texel % period + period) % period;
  return in_period < size ? in_period : 2 * size - 1 - in_period;
}

Rgba texture_at(const SurfaceMaterial& material, double u, double v) {
  const ColorImage& image = *material.image;
  // Removes complete periods, because large coordinates lose precision.
  const double x = std::remainder(u, 2.0) * image.width - 0.5;
  const double y = std::remainder(v, 2.0) * image.height - 0.5;
  const bool far_x = material.borders[0] == Border::kClamp,
             far_y = material.borders[1] == Border::kClamp;
  const double px = far_x ? std::clamp(u, 0.0, 1.0) * image.width - 0.5 : x;
  const double py = far_y ? std::clamp(v, 0.0, 1.0) * image.height - 0.5 : y;
  const double left = std::floor(px), top = std::floor(py);
  Rgba out{};
  for (int j = 0; j < 2; ++j)
    for (int i = 0; i < 2; ++i) {
      const int tx = bordered(static_cast<int>(left) + i, image.width, material.borders[0]);
      const int ty = bordered(static_cast<int>(top) + j, image.height, material.borders[1]);
      const double weight = (i ? px - left : 1 - (px - left)) * (j ? py - top : 1 - (py - top));
      const auto& texel = image.texels[static_cast<size_t>(ty) * static_cast<size_t>(image.width) +
                                       static_cast<size_t>(tx)];
      for (size_t c = 0; c < 4; ++c) out[c] += weight * static_cast<double>(texel[c]);
    }
  return out;
}

// Returns the color and the opacity of a point of the surface.
Rgba look_at(const Surface& surface, const std::array<double, 3>& shares) {
  const SurfaceMaterial& material = *surface.material;
  Rgba out = material.factor;
  double u = 0, v = 0;
  Rgba tint{};
  for (size_t i = 0; i < 3; ++i) {
    u += shares[i] * surface.corners[i].texture[0];
    v += shares[i] * surface.corners[i].texture[1];
    for (size_t c = 0; c < 4; ++c) tint[c] += shares[i] * surface.corners[i].color[c];
  }
  Rgba texel{1, 1, 1, 1};
  if (material.image) texel = texture_at(material, u, v);
  for (size_t c = 0; c < 4; ++c) out[c] *= tint[c] * texel[c];
  if (material.transparency == Transparency::kNone) out[3] = 1;
  if (material.transparency == Transparency::kCutoff) out[3] = out[3] >= material.cutoff ? 1 : 0;
  return out;
}

// Returns point k of a sequence that covers a triangle evenly, in barycentric coordinates. The
// sequence is a lattice with the steps of the plastic number; points outside the triangle are
// folded into it.
std::array<double, 3> spread_point(int k) {
  const double steps[] = {0.7548776662466927, 0.5698402909980532};
  double s = std::fmod(0.5 + k * steps[0], 1.0), t = std::fmod(0.5 + k * steps[1], 1.0);
  if (s + t > 1) {
    s = 1 - s;
    t = 1 - t;
  }
  return {1 - s - t, s, t};
}

struct Piece {
  const Surface* surface;
  SurfacePoint corners[3];
  double area_up_to;  // total area of this piece and all earlier pieces
};

std::vector<Piece> pieces_in(std::span<const Surface* const> surfaces, const Point& low,
                             int64_t edge) {
  std::vector<Piece> pieces;
  double area = 0;
  for (const Surface* const surface : surfaces) {
    const Polygon polygon = in_cube(*surface, low, static_cast<double>(edge));
    for (size_t i = 2; i < polygon.size(); ++i) {
      area += area_of(polygon[0], polygon[i - 1], polygon[i]);
      pieces.push_back({surface, {polygon[0], polygon[i - 1], polygon[i]}, area});
    }
  }
  return pieces;
}

}  // namespace

double srgb_to_linear(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

double linear_to_srgb(double linear) {
  return linear <= 0.0031308 ? linear * 12.92 : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

std::optional<std::array<uint8_t, 3>> mean_color(std::span<const Surface* const> surfaces,
                                                 const Point& low, int64_t edge, int points) {
  const std::vector<Piece> pieces = pieces_in(surfaces, low, edge);
  // Smaller areas are rounding errors of surfaces that only touch the cube.
  const double least = 1e-9 * static_cast<double>(edge) * static_cast<double>(edge);
  if (pieces.empty() || pieces.back().area_up_to <= least) return std::nullopt;
  std::array<double, 3> seen{}, plain{};
  double opacity = 0;
  size_t piece = 0;
  for (int k = 0; k < points; ++k) {
    const double area = (k + 0.5) / points * pieces.back().area_up_to;
    while (pieces[piece].area_up_to < area) ++piece;
    const std::array<double, 3> spread = spread_point(k);
    std::array<double, 3> shares{};
    for (size_t i = 0; i < 3; ++i)
      for (size_t j = 0; j < 3; ++j) shares[i] += spread[j] * pieces[piece].corners[j].shares[i];
    const Rgba look = look_at(*pieces[piece].surface, shares);
    opacity += look[3];
    for (size_t c = 0; c < 3; ++c) {
      seen[c] += look[3] * look[c];
      plain[c] += look[c];
    }
  }
  std::array<uint8_t, 3> color;
  for (size_t c = 0; c < 3; ++c) {
    const double mean = opacity > 0 ? seen[c] / opacity : plain[c] / points;
    color[c] = static_cast<uint8_t>(std::lround(255 * std::min(linear_to_srgb(mean), 1.0)));
  }
  return color;
}

void ColorError::add(const std::array<uint8_t, 3>& a, const std::array<uint8_t, 3>& b) {
  int worst = 0;
  for (size_t c = 0; c < 3; ++c) {
    const int difference = std::abs(a[c] - b[c]);
    squares_ += difference * difference;
    worst = std::max(worst, difference);
  }
  ++colors_;
  ++worst_[static_cast<size_t>(worst)];
}

double ColorError::psnr() const {
  return 10 * std::log10(255.0 * 255.0 / (squares_ / (3 * static_cast<double>(colors_))));
}

double ColorError::part_above(int difference) const {
  uint64_t above = 0;
  for (size_t d = static_cast<size_t>(difference) + 1; d < worst_.size(); ++d) above += worst_[d];
  return static_cast<double>(above) / static_cast<double>(colors_);
}

}  // namespace oracle
