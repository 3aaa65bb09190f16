// The reference color of a cube of the grid: the mean color, in linear light, of the surfaces in
// the closed cube, over many points that cover the surfaces evenly. Triangles are clipped to the
// cube. Images are sampled bilinearly at their finest level. All computations are in doubles.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "tests/oracle/triangle.h"

namespace oracle {

using Rgba = std::array<double, 4>;  // linear, 0 to 1

struct ColorImage {
  int width = 0, height = 0;
  std::vector<std::array<float, 4>> texels;  // linear, row by row from the top
};

enum class Border { kRepeat, kMirror, kClamp };
enum class Transparency { kNone, kCutoff, kBlend };

struct SurfaceMaterial {
  Rgba factor{1, 1, 1, 1};
  const ColorImage* image = nullptr;
  std::array<Border, 2> borders{};
  Transparency transparency = Transparency::kNone;
  double cutoff = 0.5;
};

struct Surface {
  struct Corner {
    std::array<double, 2> texture{};  // in units of the image's width and height
    Rgba color{1, 1, 1, 1};
  };
  Triangle position{};
  std::array<Corner, 3> corners;
  const SurfaceMaterial* material = nullptr;
};

// The transfer function of sRGB (IEC 61966-2-1). Argument and result are from 0 to 1.
double srgb_to_linear(double encoded);
double linear_to_srgb(double linear);

// Returns the mean color in 8 bits. Returns nullopt if the surfaces have no area in the cube,
// because they touch it only in points or lines. Surfaces are weighted by area and alpha, or only
// by area if all points are transparent. `points` is the number of samples.
std::optional<std::array<uint8_t, 3>> mean_color(std::span<const Surface* const> surfaces,
                                                 const Point& low, int64_t edge, int points = 128);

// Sums squared differences of 8-bit colors.
class ColorError {
 public:
  void add(const std::array<uint8_t, 3>& a, const std::array<uint8_t, 3>& b);
  uint64_t colors() const { return colors_; }
  // Returns the peak signal-to-noise ratio in dB; infinite if all colors were equal.
  double psnr() const;
  // Returns the fraction of the colors that differ by more than `difference` in any channel.
  double part_above(int difference) const;

 private:
  double squares_ = 0;
  uint64_t colors_ = 0;
  std::array<uint64_t, 256> worst_{};
};

}  // namespace oracle
