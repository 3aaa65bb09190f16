// The light that each pixel gathered, before it is developed into colors, and a filter that takes
// the grain out of it: few rays to the sky are enough where neighbors on the same surface agree.
#pragma once

#include <vector>

#include "query/render/camera.h"
#include "query/vec.h"

namespace voxdag::query {

// Means over a pixel's samples; of those that met a surface, but for `floor`.
struct LightPixel {
  float coverage = 0;  // share of the samples that met a surface
  float t = 0;         // distance
  float normal[3] = {};
  float sky[3] = {};
  float lamp = 0;   // share of the lamp that is seen, dimmed by distance; not yet by the normal
  float floor = 1;  // of those that did not
};

class LightBuffer {
 public:
  LightBuffer(int width, int height)
      : width_(width),
        height_(height),
        pixels_(static_cast<size_t>(width) * static_cast<size_t>(height)) {}
  int width() const { return width_; }
  int height() const { return height_; }
  LightPixel& at(int x, int y) { return pixels_[index(x, y)]; }
  const LightPixel& at(int x, int y) const { return pixels_[index(x, y)]; }

  // The pixel, its light from the sky averaged over the neighbors that lie on the plane of its
  // surface (or, where it shows none, are on the floor); lamp and normal too, over fewer of them.
  LightPixel smoothed(const Camera& camera, int x, int y) const;

 private:
  size_t index(int x, int y) const {
    return static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x);
  }

  int width_, height_;
  std::vector<LightPixel> pixels_;
};

}  // namespace voxdag::query
