#include "query/render/renderer.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/base/error.h"
#include "core/base/parallel_for.h"
#include "query/render/albedo.h"
#include "query/render/g_buffer.h"
#include "query/render/lighting.h"
#include "query/render/surface_hit.h"

namespace voxdag::query {
namespace {

constexpr Vec kTopColor{{0.46, 0.54, 0.65}}, kBottomColor{{0.86, 0.87, 0.88}};
constexpr double kMaxHaze = 0.25;

// Returns the sRGB byte of a linear intensity. `dither`, in [0, 1), differs between neighbor
// pixels. It decides whether the byte is rounded up or down, so that gradients show no steps.
uint8_t srgb_byte(double linear, double dither) {
  const double v = std::clamp(linear, 0.0, 1.0);
  const double s = v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
  return static_cast<uint8_t>(std::min(255.0, 255 * s + dither));
}

// Casts rays through a coarse grid of points in the picture. Returns the surfaces that they meet,
// nearest first.
std::vector<SurfaceHit> probe_view(const DagView& dag, const Camera& camera, int width,
                                   int height) {
  constexpr int kColumns = 40, kRows = 24;
  std::vector<SurfaceHit> seen;
  SurfaceHit s;
  for (int i = 0; i < kColumns * kRows; ++i) {
    const double x = (i % kColumns + 0.5) / kColumns, y = (i / kColumns + 0.5) / kRows;
    if (find_surface(dag, camera.ray(x * width, y * height), camera.pixel_spread(), s))
      seen.push_back(s);
  }
  std::sort(seen.begin(), seen.end(),
            [](const SurfaceHit& a, const SurfaceHit& b) { return a.t < b.t; });
  return seen;
}

// Returns the factor by which all light is multiplied before tone mapping. The factor is chosen as
// if all probed surfaces were of plaster: then their median light is a middle tone or darker, and
// 90% of them are below white. The surfaces' own colors are ignored so that dark surfaces remain
// dark.
double choose_exposure(const Lighting& lighting, const std::vector<SurfaceHit>& seen) {
  constexpr int kSkyRays = 8;
  if (seen.empty()) return 1;
  std::vector<double> luminance;
  for (const SurfaceHit& s : seen) {
    const Sampler sampler(luminance.size());
    const Vec light =
        lighting.reflected(kPlaster, s.normal, lighting.sky_light(s, kSkyRays, sampler),
                           lighting.sun_light(s, sampler));
    luminance.push_back(1e-3 + dot(light, {{0.2126, 0.7152, 0.0722}}));
  }
  std::sort(luminance.begin(), luminance.end());
  return std::min(0.42 / luminance[luminance.size() / 2],
                  0.85 / luminance[luminance.size() * 9 / 10]);
}

// Applies a filmic curve that compresses bright light (the ACES fit of Narkowicz 2015).
Vec tone_map(const Vec& light) {
  Vec out;
  for (int i = 0; i < 3; ++i) {
    const double x = light[i];
    out[i] = std::min(1.0, x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14));
  }
  return out;
}

// Takes samples^2 samples of the pixel (x, y) and combines them.
template <class AlbedoOf>
GBufferPixel sample_pixel(const DagView& dag, const Camera& camera, const Lighting& lighting,
                          const AlbedoOf& albedo_of, int samples, int x, int y) {
  constexpr int kSkyRays = 4;
  Vec offset, normal, reflecting, sky;
  double sun = 0, floor = 0;
  int surfaces = 0, misses = 0;
  for (int i = 0; i < samples * samples; ++i) {
    const Sampler sampler(x, y, i);
    const Sampler::Pair within = sampler.pair(0);
    const Ray ray =
        camera.ray(x + (i % samples + within.u) / samples, y + (i / samples + within.v) / samples);
    SurfaceHit s;
    if (!find_surface(dag, ray, camera.pixel_spread(), s)) {
      ++misses;
      floor += lighting.floor_light(ray, sampler);
      continue;
    }
    ++surfaces;
    offset = offset + ray.direction * s.t;
    normal = normal + s.normal;
    reflecting = reflecting + albedo_of(s);
    sky = sky + lighting.sky_light(s, kSkyRays, sampler);
    sun += lighting.sun_light(s, sampler);
  }
  GBufferPixel p;
  if (misses > 0) p.floor = static_cast<float>(floor / misses);
  if (surfaces == 0) return p;
  p.coverage = static_cast<float>(surfaces) / static_cast<float>(surfaces + misses);
  p.offset = offset * (1.0 / surfaces);
  p.normal = normal * (1 / std::max(length(normal), 1e-9));
  p.albedo = reflecting * (1.0 / surfaces);
  p.sky = sky * (1.0 / surfaces);
  p.sun = static_cast<float>(sun / surfaces);
  return p;
}

// Returns the light of the background in one row of the picture. `height` is from 0 at the upper
// edge of the picture to 1 at the lower edge.
Vec background_of(Background background, double height) {
  if (background == Background::kSky) return mix(kTopColor, kBottomColor, height);
  return {{1, 1, 1}};
}

// A pixel before its channels are rounded to bytes.
struct FinalPixel {
  Vec color;
  double alpha = 1;
};

// Computes a pixel's color from the light of its surface: applies the exposure and the tone mapping
// and, if the background is not transparent, adds haze and the background.
struct ColorGrading {
  const Lighting& lighting;
  Background kind;
  Shade shade;
  double exposure, haze_start, diagonal;

  FinalPixel of(const GBufferPixel& p, const Vec& background) const {
    if (kind == Background::kTransparent) return {lit(p), p.coverage};
    Vec color = background * p.floor;
    if (p.coverage > 0) {
      const double haze = shade == Shade::kNormal ? 0 : kMaxHaze;
      const double depth = std::max(0.0, length(p.offset) - haze_start) / std::max(1.0, diagonal);
      const Vec surface = mix(lit(p), background, haze * (1 - std::exp(-depth * depth)));
      color = mix(color, surface, p.coverage);
    }
    return {color};
  }

 private:
  Vec lit(const GBufferPixel& p) const {
    if (p.coverage == 0) return {};
    if (shade == Shade::kNormal) return p.albedo;
    return tone_map(lighting.reflected(p.albedo, p.normal, p.sky, p.sun) * exposure);
  }
};

}  // namespace

const std::vector<std::string>& background_names() {
  static const std::vector<std::string> names = {"sky", "white", "transparent"};
  return names;
}

Background background_named(const std::string& name) {
  const auto& names = background_names();
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end())
    throw Error(ErrorCode::kInvalidInput,
                "background '" + name + "': expected one of sky, white, transparent");
  return static_cast<Background>(found - names.begin());
}

Picture render_picture(const DagView& dag, const Placement& placement, const RenderOptions& options,
                       Progress& progress, const CancelToken& cancel) {
  const int width = options.width, height = options.height;
  const Camera camera(placement, width, height);
  const Box box = dag.empty() ? Box{} : occupied_box(dag);
  const std::vector<SurfaceHit> seen = probe_view(dag, camera, width, height);
  const Lighting lighting(dag, box, camera, seen);
  const double exposure = choose_exposure(lighting, seen);
  const double haze_start = seen.empty() ? 0 : seen[0].t;

  const ShadeColors shades(dag, options.shade);
  GBuffer buffer(width, height);
  progress.begin_stage("render", static_cast<uint64_t>(height), "rows");
  const unsigned workers = std::clamp(options.threads, 1u, static_cast<unsigned>(height));
  std::vector<Albedo> albedos(workers, Albedo(options.colors));
  const auto for_each_row = [&](const auto& work) {
    parallel_for(workers, static_cast<size_t>(height),
                 [&](unsigned worker, size_t row) { work(worker, static_cast<int>(row)); });
  };
  for_each_row([&](unsigned worker, int y) {
    const auto albedo_of = [&](const SurfaceHit& surface) {
      return options.shade == Shade::kColor ? albedos[worker].of(surface) : shades.of(surface);
    };
    for (int x = 0; x < width; ++x) {
      cancel.check();
      buffer.at(x, y) = sample_pixel(dag, camera, lighting, albedo_of, options.samples, x, y);
    }
    progress.advance(1);
  });
  progress.end_stage();

  Picture picture(width, height, channels_of(options.background));
  const ColorGrading grading{lighting, options.background, options.shade,
                             exposure, haze_start,         box.diagonal()};
  for_each_row([&](unsigned, int y) {
    constexpr int kBayer[4][4] = {{0, 8, 2, 10}, {12, 4, 14, 6}, {3, 11, 1, 9}, {15, 7, 13, 5}};
    const Vec background = background_of(options.background, (y + 0.5) / height);
    for (int x = 0; x < width; ++x) {
      const FinalPixel shown = grading.of(buffer.smoothed(x, y, camera.pixel_spread()), background);
      const double dither = (kBayer[y % 4][x % 4] + 0.5) / 16;
      uint8_t* const pixel = picture.pixel(x, y);
      for (int c = 0; c < 3; ++c) pixel[c] = srgb_byte(shown.color[c], dither);
      if (picture.channels == 4) pixel[3] = static_cast<uint8_t>(std::lround(255 * shown.alpha));
    }
  });
  return picture;
}

}  // namespace voxdag::query
