#include "query/render/film.h"

#include <algorithm>

namespace voxdag::query {
namespace {

constexpr Vec kAlbedo{{0.74, 0.70, 0.64}};
constexpr Vec kLamplight{{3.6, 3.2, 2.6}};
constexpr Vec kTopColor{{0.46, 0.54, 0.65}}, kBottomColor{{0.86, 0.87, 0.88}};
constexpr double kMaxHaze = 0.25;

Vec reflected(const LightPixel& p) {
  Vec out;
  for (int c = 0; c < 3; ++c) out[c] = kAlbedo[c] * (p.sky[c] + kLamplight[c] * p.lamp);
  return out;
}

double luminance(const Vec& c) { return 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]; }

// Narkowicz 2015: steep in the middle, bright light compressed.
Vec film_curve(const Vec& light) {
  Vec out;
  for (int i = 0; i < 3; ++i) {
    const double x = light[i];
    out[i] = std::min(1.0, x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14));
  }
  return out;
}

}  // namespace

// The middle of what is seen comes out in the middle of the curve, its lightest tenth still short
// of white.
ToneMapper::ToneMapper(const std::vector<LightPixel>& seen, double extent, int height)
    : extent_(std::max(extent, 1.0)), height_(height) {
  if (seen.empty()) return;
  std::vector<double> light;
  haze_start_ = seen[0].t;
  for (const LightPixel& p : seen) {
    light.push_back(1e-3 + luminance(reflected(p)));
    haze_start_ = std::min<double>(haze_start_, p.t);
  }
  std::sort(light.begin(), light.end());
  exposure_ = std::min(0.42 / light[light.size() / 2], 0.85 / light[light.size() * 9 / 10]);
}

Vec ToneMapper::color(const LightPixel& p, int y) const {
  const Vec background = mix(kTopColor, kBottomColor, (y + 0.5) / height_);
  const double depth = std::max(0.0, (p.t - haze_start_) / extent_);
  const Vec surface = mix(film_curve(reflected(p) * exposure_), background,
                          kMaxHaze * (1 - std::exp(-depth * depth)));
  return mix(background * p.floor, surface, p.coverage);
}

}  // namespace voxdag::query
