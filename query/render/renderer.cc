#include "query/render/renderer.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "query/render/bounds.h"
#include "query/render/film.h"
#include "query/render/light_buffer.h"
#include "query/render/lighting.h"
#include "query/render/surface.h"

namespace voxdag::query {
namespace {

// `dither` in [0, 1) spreads what rounding would make steps of.
uint8_t srgb_byte(double linear, double dither) {
  const double v = std::clamp(linear, 0.0, 1.0);
  const double s = v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
  return static_cast<uint8_t>(std::min(255.0, 255 * s + dither));
}

// What the camera sees through a coarse grid of points.
std::vector<Surface> first_look(const DagView& dag, const Camera& camera, int width, int height) {
  constexpr int kColumns = 40, kRows = 24;
  std::vector<Surface> seen;
  Surface s;
  for (int i = 0; i < kColumns * kRows; ++i) {
    const double x = (i % kColumns + 0.5) / kColumns, y = (i / kColumns + 0.5) / kRows;
    if (find_surface(dag, camera.ray(x * width, y * height), camera.pixel_spread(), s))
      seen.push_back(s);
  }
  return seen;
}

// Adds up what the samples of a pixel find.
class Gatherer {
 public:
  Gatherer(const Lighting& lighting) : lighting_(lighting) {}

  void add(const Surface& s, int sky_rays, Sampler& sampler) {
    ++surfaces_;
    t_ += s.t;
    normal_ = normal_ + s.normal;
    sky_ = sky_ + lighting_.skylight(s, sky_rays, sampler);
    lamp_ += lighting_.lamplight(s, sampler);
  }
  void add_miss(const Ray& ray, Sampler& sampler) {
    ++misses_;
    floor_ += lighting_.floor_light(ray, sampler);
  }

  LightPixel pixel() const {
    LightPixel p;
    if (misses_ > 0) p.floor = static_cast<float>(floor_ / misses_);
    if (surfaces_ == 0) return p;
    p.coverage = static_cast<float>(surfaces_) / static_cast<float>(surfaces_ + misses_);
    p.t = static_cast<float>(t_ / surfaces_);
    p.lamp = static_cast<float>(lamp_ / surfaces_);
    const double normal_length = std::max(length(normal_), 1e-9);
    for (int i = 0; i < 3; ++i) {
      p.normal[i] = static_cast<float>(normal_[i] / normal_length);
      p.sky[i] = static_cast<float>(sky_[i] / surfaces_);
    }
    return p;
  }

 private:
  const Lighting& lighting_;
  int surfaces_ = 0, misses_ = 0;
  double t_ = 0, lamp_ = 0, floor_ = 0;
  Vec normal_, sky_;
};

LightPixel gather_pixel(const DagView& dag, const Camera& camera, const Lighting& lighting,
                        int samples, int x, int y) {
  constexpr int kSkyRays = 4;
  Gatherer gatherer(lighting);
  for (int i = 0; i < samples * samples; ++i) {
    Sampler sampler(x, y, i);
    const Sampler::Pair within = sampler.pair();
    const Ray ray =
        camera.ray(x + (i % samples + within.u) / samples, y + (i / samples + within.v) / samples);
    Surface s;
    if (find_surface(dag, ray, camera.pixel_spread(), s))
      gatherer.add(s, kSkyRays, sampler);
    else
      gatherer.add_miss(ray, sampler);
  }
  return gatherer.pixel();
}

// The light on the surfaces of a first look, for choosing an exposure.
std::vector<LightPixel> first_light(const Lighting& lighting, const std::vector<Surface>& seen) {
  constexpr int kSkyRays = 8;
  std::vector<LightPixel> light;
  for (const Surface& s : seen) {
    Sampler sampler(light.size());
    Gatherer gatherer(lighting);
    gatherer.add(s, kSkyRays, sampler);
    light.push_back(gatherer.pixel());
    light.back().lamp *= static_cast<float>(lighting.facing_lamp(s.start, s.normal));
  }
  return light;
}

void develop_row(const LightBuffer& light, const Camera& camera, const Lighting& lighting,
                 const ToneMapper& film, int y, Picture& picture) {
  constexpr int kBayer[4][4] = {{0, 8, 2, 10}, {12, 4, 14, 6}, {3, 11, 1, 9}, {15, 7, 13, 5}};
  for (int x = 0; x < picture.width; ++x) {
    LightPixel pixel = light.smoothed(camera, x, y);
    if (pixel.coverage > 0)
      pixel.lamp *= static_cast<float>(
          lighting.facing_lamp(camera.ray(x + 0.5, y + 0.5).at(pixel.t),
                               {{pixel.normal[0], pixel.normal[1], pixel.normal[2]}}));
    const Vec color = film.color(pixel, y);
    const double dither = (kBayer[y % 4][x % 4] + 0.5) / 16;
    for (int c = 0; c < 3; ++c) picture.pixel(x, y)[c] = srgb_byte(color[c], dither);
  }
}

// Runs work(0) to work(count - 1) on threads; the first exception stops all and is thrown.
template <class Work>
void for_each_row(int count, int threads, const Work& work) {
  std::atomic<int> next{0};
  std::exception_ptr failure;
  std::mutex mutex;
  const auto run = [&] {
    try {
      for (int row; (row = next.fetch_add(1)) < count;) work(row);
    } catch (...) {
      const std::lock_guard lock(mutex);
      if (!failure) failure = std::current_exception();
      next = count;
    }
  };
  std::vector<std::jthread> helpers;
  for (int i = 1; i < threads; ++i) helpers.emplace_back(run);
  run();
  helpers.clear();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace

Picture render_picture(const DagView& dag, const Placement& placement, const RenderOptions& options,
                       Progress& progress, const CancelToken& cancel) {
  const int width = options.width, height = options.height;
  const Camera camera(placement, width, height);
  const Box box = dag.empty() ? Box{} : occupied_box(dag);
  const std::vector<Surface> seen = first_look(dag, camera, width, height);
  const Lighting lighting(dag, box, camera, seen);
  const ToneMapper film(first_light(lighting, seen), box.diagonal(), height);

  LightBuffer light(width, height);
  progress.begin_stage("render", static_cast<uint64_t>(height), "rows");
  for_each_row(height, options.threads, [&](int y) {
    for (int x = 0; x < width; ++x) {
      cancel.check();
      light.at(x, y) = gather_pixel(dag, camera, lighting, options.samples, x, y);
    }
    progress.advance(1);
  });
  progress.end_stage();

  Picture picture(width, height);
  for_each_row(height, options.threads,
               [&](int y) { develop_row(light, camera, lighting, film, y, picture); });
  return picture;
}

}  // namespace voxdag::query
