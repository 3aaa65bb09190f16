// A fractal heightfield on a square of 1024 x 1024: octaves of gradient noise, ridged on high land
// and smooth on low land. Two more octaves shift the coordinates at which the noise is evaluated,
// so that valleys wind. Each octave has half the wavelength of the previous one. The shortest
// wavelength is four cells of the field.
#include <cmath>

#include "scene/generate/random.h"
#include "scene/generate/scene_builder.h"

namespace voxdag {
namespace {

constexpr double kEdge = 1024;
constexpr double kHeight = 170;
constexpr uint32_t kTileCells = 254;  // (254 + 1)^2 vertices fit a mesh

class Noise {
 public:
  explicit Noise(uint64_t seed) : seed_(mix_bits(seed)) {}

  // Returns gradient noise: from about -1 to about 1, and 0 at integer coordinates. Coordinates
  // must not be negative.
  double at(double x, double z, uint64_t octave) const {
    const auto ix = static_cast<uint64_t>(x), iz = static_cast<uint64_t>(z);
    const double fx = x - static_cast<double>(ix), fz = z - static_cast<double>(iz);
    const double u = smooth(fx), v = smooth(fz);
    const double low = mix(slope(ix, iz, octave, fx, fz), slope(ix + 1, iz, octave, fx - 1, fz), u);
    const double high = mix(slope(ix, iz + 1, octave, fx, fz - 1),
                            slope(ix + 1, iz + 1, octave, fx - 1, fz - 1), u);
    return 1.5 * mix(low, high, v);
  }

 private:
  static double mix(double a, double b, double t) { return a + (b - a) * t; }
  static double smooth(double t) { return t * t * t * (t * (t * 6 - 15) + 10); }

  double slope(uint64_t ix, uint64_t iz, uint64_t octave, double fx, double fz) const {
    static constexpr double kGradients[8][2] = {{1, 0},        {0, 1},        {-1, 0},
                                                {0, -1},       {0.75, 0.75},  {0.75, -0.75},
                                                {-0.75, 0.75}, {-0.75, -0.75}};
    const uint64_t h = mix_bits(seed_ + octave * 0x9e3779b97f4a7c15ull + (ix << 32 ^ iz));
    const auto& g = kGradients[h >> 61];
    return g[0] * fx + g[1] * fz;
  }

  const uint64_t seed_;
};

class Heights {
 public:
  Heights(uint64_t seed, uint64_t cells) : noise_(seed), cells_(cells) {
    for (uint64_t c = cells / 16; c > 0; c /= 2) ++octaves_;
  }

  Vec3 vertex(uint64_t i, uint64_t j) const {
    const double s = static_cast<double>(i) / static_cast<double>(cells_);
    const double t = static_cast<double>(j) / static_cast<double>(cells_);
    return {(s - 0.5) * kEdge, height(s, t) * kHeight, (t - 0.5) * kEdge};
  }

 private:
  // Returns the height, from about 0 to about 1, at a point of the square [0, 1]^2.
  double height(double s, double t) const {
    const double x = 8 + 2.5 * s + 0.12 * noise_.at(8 + 6 * s, 8 + 6 * t, 100);
    const double z = 8 + 2.5 * t + 0.12 * noise_.at(8 + 6 * s, 8 + 6 * t, 101);
    const double land = 0.5 + 0.6 * noise_.at(x * 0.7, z * 0.7, 0);
    // High land is rough. Where one octave is smooth, the following octaves are also smooth.
    double weight = land < 0.15 ? 0.15 : land > 1 ? 1 : land;
    double sum = 0.55 * land, frequency = 1.5, amplitude = 0.42;
    for (uint64_t octave = 1; octave <= octaves_; ++octave) {
      const double ridge = 1 - std::fabs(noise_.at(x * frequency, z * frequency, octave));
      const double signal = ridge * ridge * weight;
      sum += signal * amplitude;
      weight = signal * 1.9 > 1 ? 1 : signal * 1.9;
      frequency *= 2;
      amplitude *= 0.5;
    }
    return sum;
  }

  const Noise noise_;
  const uint64_t cells_;
  uint64_t octaves_ = 2;
};

void make_tile(SceneBuilder& scene, const Heights& heights, uint64_t i0, uint64_t j0,
               uint32_t width, uint32_t depth) {
  MeshBuilder& mesh = scene.mesh_for((width + 1) * (depth + 1), 2 * width * depth);
  const uint32_t first = mesh.vertices();
  for (uint32_t i = 0; i <= width; ++i)
    for (uint32_t j = 0; j <= depth; ++j) mesh.add_vertex(heights.vertex(i0 + i, j0 + j));
  for (uint32_t i = 0; i < width; ++i)
    for (uint32_t j = 0; j < depth; ++j) {
      const uint32_t a = first + i * (depth + 1) + j, b = a + depth + 1;
      mesh.add_triangle(a, a + 1, b + 1);
      mesh.add_triangle(a, b + 1, b);
    }
}

}  // namespace

void make_terrain(const GenerateOptions& options, SceneBuilder& scene) {
  uint64_t cells = 1;
  while (2 * (cells + 1) * (cells + 1) <= options.triangles) ++cells;
  const Heights heights(options.seed, cells);
  for (uint64_t i = 0; i < cells; i += kTileCells)
    for (uint64_t j = 0; j < cells; j += kTileCells)
      make_tile(scene, heights, i, j,
                static_cast<uint32_t>(std::min<uint64_t>(kTileCells, cells - i)),
                static_cast<uint32_t>(std::min<uint64_t>(kTileCells, cells - j)));
}

}  // namespace voxdag
