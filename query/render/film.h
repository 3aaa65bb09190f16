// Develops light into colors: an exposure for what is seen, a film's curve, a little haze with
// distance, a plain background.
#pragma once

#include <vector>

#include "query/render/light_buffer.h"
#include "query/vec.h"

namespace voxdag::query {

class ToneMapper {
 public:
  // `seen` is a sample of the pixels that show a surface; `extent` the scene's, in voxels.
  ToneMapper(const std::vector<LightPixel>& seen, double extent, int height);

  // Linear red, green, blue in [0, 1] of a pixel in row `y`.
  Vec color(const LightPixel& pixel, int y) const;

 private:
  double exposure_ = 1;
  double haze_start_ = 0;
  const double extent_;
  const double height_;
};

}  // namespace voxdag::query
