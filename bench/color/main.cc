// Measures the CPU time for computing colors by the color rule and for encoding them, on one core.
//
//     bench_color [K]
//
// The scene is a generated wavy, tilted sphere with an image of 1024^2 texels, in a color grid of
// K^3 cells (default 1024). Its colors are computed region by region, as in a build. Prints
// nanoseconds of CPU time per colored cell, the minimum of three runs.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <random>
#include <vector>

#include "core/color/blocks/region.h"
#include "core/color/rule/bake_region.h"
#include "scene/textures/pyramid.h"

namespace voxdag {
namespace {

constexpr int kRuns = 3;
constexpr uint32_t kImageEdge = 1024;
// The triangles of the sphere are about 16 x 16 cells large.
constexpr double kTriangleCells = 16;

double cpu_seconds() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

// An image of waves with noise, as a pyramid of levels.
struct Image {
  MemoryBudget budget{uint64_t{1} << 30};
  TextureLayout layout;
  std::vector<uint64_t> pages;

  Image() {
    layout.levels = pyramid_levels(kImageEdge, kImageEdge, 0);
    layout.first_level = {0, static_cast<uint32_t>(layout.levels.size())};
    const TextureLevel& last = layout.levels.back();
    pages.resize(static_cast<size_t>(last.first_page + last.pages()) * kPageTexels);
    PyramidBuilder builder(layout.levels, budget, [&](uint64_t first, auto texels) {
      std::ranges::copy(texels, pages.begin() + static_cast<ptrdiff_t>(first * kPageTexels));
    });
    std::mt19937 random(1);
    std::vector<uint64_t> row(kImageEdge);
    for (uint32_t y = 0; y < kImageEdge; ++y) {
      for (uint32_t x = 0; x < kImageEdge; ++x) {
        row[x] = uint64_t{0xffff} << 48;
        for (uint32_t c = 0; c < 3; ++c) {
          const double wave = std::sin(0.013 * (c + 1) * x + 0.021 * y) + 1;
          row[x] |= static_cast<uint64_t>(28000 * wave + random() % 9000) << 16 * c;
        }
      }
      builder.add_row(row);
    }
  }
};

// Returns the point of the sphere at `along` (fraction of a parallel) and `up` (fraction of a
// meridian).
std::array<int64_t, 3> point_at(const ColorGrid& grid, double along, double up) {
  const double edge = static_cast<double>(uint64_t{kUnitsPerVoxel} << grid.levels);
  const double angle = 2 * M_PI * along, height = M_PI * up;
  const double radius = edge * (0.38 + 0.02 * std::sin(7 * angle) * std::sin(5 * height));
  const double x = std::sin(height) * std::cos(angle), y = std::sin(height) * std::sin(angle),
               z = std::cos(height);
  const auto place = [&](double at) { return static_cast<int64_t>(edge / 2 + radius * at) | 1; };
  return {place(0.8 * x + 0.6 * z), place(y), place(0.8 * z - 0.6 * x)};
}

std::vector<FixedSurface> sphere(const ColorGrid& grid) {
  const auto rows =
      static_cast<int>(std::ldexp(1.2 / kTriangleCells, static_cast<int>(grid.color_levels)));
  std::vector<FixedSurface> surfaces;
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < 2 * rows; ++j)
      for (int half = 0; half < 2; ++half) {
        FixedSurface surface;
        for (int k = 0; k < 3; ++k) {
          const int corner = half == 0 ? k : 3 - k;
          const double along = (j + corner % 2) / (2.0 * rows),
                       up = (i + corner / 2) / (1.0 * rows);
          const auto point = point_at(grid, along, up);
          std::copy(point.begin(), point.end(), surface.position.v[k]);
          surface.corners[static_cast<size_t>(k)].texture = {
              static_cast<int64_t>(6 * along * (1 << kTextureBits)),
              static_cast<int64_t>(3 * up * (1 << kTextureBits))};
        }
        surfaces.push_back(surface);
      }
  return surfaces;
}

// Returns the surfaces by region, in Morton order of the regions. A surface is listed for each
// region that its bounding box touches.
std::vector<std::vector<FixedSurface>> by_region(const ColorGrid& grid) {
  const uint32_t level = grid.region_level();
  std::vector<std::vector<FixedSurface>> regions(size_t{1} << 3 * level);
  for (const FixedSurface& surface : sphere(grid)) {
    const CellBox box(surface.position, grid.levels, level);
    for (int64_t x = box.low[0]; x <= box.high[0]; ++x)
      for (int64_t y = box.low[1]; y <= box.high[1]; ++y)
        for (int64_t z = box.low[2]; z <= box.high[2]; ++z)
          regions[morton_encode(static_cast<uint32_t>(x), static_cast<uint32_t>(y),
                                static_cast<uint32_t>(z))]
              .push_back(surface);
  }
  return regions;
}

void run(uint32_t color_levels) {
  const ColorGrid grid{color_levels, color_levels};
  const Image image;
  Material material;
  material.image = 0;
  const auto regions = by_region(grid);
  TextureReader textures(image.layout, image.pages.data());
  RegionBaker<TextureReader> baker(grid, {&material, 1}, textures);
  double rule = 1e9, encoding = 1e9;
  uint64_t count = 0, bytes = 0;
  for (int i = 0; i < kRuns; ++i) {
    double baked = 0, encoded = 0;
    count = bytes = 0;
    for (uint64_t morton = 0; morton < regions.size(); ++morton) {
      if (regions[morton].empty()) continue;
      Cube region{grid.region_level(), {}};
      morton_decode(morton, region.position[0], region.position[1], region.position[2]);
      RegionEncoder encoder(color_levels - grid.region_level());
      const double start = cpu_seconds();
      baker.begin(region);
      baker.add(regions[morton]);
      const double middle = cpu_seconds();
      baked += middle - start;
      baker.finish(0, encoder);
      if (encoder.empty()) continue;
      const EncodedRegion result = encoder.finish(morton);
      encoded += cpu_seconds() - middle;
      count += result.counts[0];
      bytes += result.blocks.size();
    }
    rule = std::min(rule, baked);
    encoding = std::min(encoding, encoded);
  }
  const double each = 1e9 / static_cast<double>(count);
  std::printf("%llu cells, %.2f bits each: rule %.1f ns, encoding %.1f ns, both %.1f ns per cell\n",
              static_cast<unsigned long long>(count),
              8 * static_cast<double>(bytes) / static_cast<double>(count), rule * each,
              encoding * each, (rule + encoding) * each);
}

}  // namespace
}  // namespace voxdag

int main(int argc, char** argv) {
  const int resolution = argc > 1 ? std::atoi(argv[1]) : 1024;
  if (resolution < 64 || resolution > 8192 || (resolution & (resolution - 1)) != 0) {
    std::fprintf(stderr, "usage: bench_color [K], a power of two, 64 <= K <= 8192\n");
    return 2;
  }
  uint32_t levels = 0;
  while (1 << levels < resolution) ++levels;
  voxdag::run(levels);
  return 0;
}
