#include "cli/render/renderer.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

#include "cli/render/bounds.h"
#include "cli/render/shader.h"

namespace voxdag::render {
namespace {

// `dither` in [0, 1) spreads what rounding would make steps of.
uint8_t srgb_byte(double linear, double dither) {
  const double v = std::clamp(linear, 0.0, 1.0);
  const double s = v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055;
  return static_cast<uint8_t>(std::min(255.0, 255 * s + dither));
}

void render_pixel(const Shader& shader, int samples, int x, int y, Picture& picture) {
  Vec sum;
  for (int i = 0; i < samples * samples; ++i) {
    const auto pixel =
        static_cast<uint64_t>(y) * static_cast<uint64_t>(picture.width) + static_cast<uint64_t>(x);
    Sampler sampler(pixel * 16, static_cast<uint64_t>(i));
    const Sampler::Pair within = sampler.pair();
    sum = sum + shader.colour(x + (i % samples + within.u) / samples,
                              y + (i / samples + within.v) / samples, sampler);
  }
  const double scale = 1.0 / (samples * samples);
  constexpr int kBayer[4][4] = {{0, 8, 2, 10}, {12, 4, 14, 6}, {3, 11, 1, 9}, {15, 7, 13, 5}};
  const double dither = (kBayer[y % 4][x % 4] + 0.5) / 16;
  for (int c = 0; c < 3; ++c) picture.pixel(x, y)[c] = srgb_byte(sum[c] * scale, dither);
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
  Picture picture(options.width, options.height);
  const Camera camera(placement, options.width, options.height);
  const Shader shader(dag, dag.empty() ? Box{} : occupied_box(dag), camera, options.width,
                      options.height);
  progress.begin_stage("render", static_cast<uint64_t>(options.height), "rows");
  for_each_row(options.height, options.threads, [&](int y) {
    for (int x = 0; x < options.width; ++x) {
      cancel.check();
      render_pixel(shader, options.samples, x, y, picture);
    }
    progress.advance(1);
  });
  progress.end_stage();
  return picture;
}

}  // namespace voxdag::render
