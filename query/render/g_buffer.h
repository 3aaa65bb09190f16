// The G-buffer: for each pixel, the visible surface and its light before tone mapping. The function
// smoothed() is a filter that removes sampling noise.
#pragma once

#include <vector>

#include "query/dag/vec.h"

namespace voxdag::query {

struct Float3 {
  float x = 0, y = 0, z = 0;
  Float3() = default;
  Float3(const Vec& v)
      : x(static_cast<float>(v[0])), y(static_cast<float>(v[1])), z(static_cast<float>(v[2])) {}
  operator Vec() const { return {{x, y, z}}; }
};

// Averages over the samples of a pixel. `floor` is an average over the samples that met no surface.
// All other members, except `coverage`, are averages over the samples that met a surface.
struct GBufferPixel {
  float coverage = 0;  // share of the samples that met a surface
  Float3 offset;       // from the eye to the surface, in voxels
  Float3 normal;       // unit vector
  Float3 albedo;       // reflected share of red, green and blue light
  Float3 sky;          // red, green and blue light from the sky; 1 is an open sky
  float sun = 0;       // share of the sun that is visible
  float floor = 1;     // brightness of the floor; 1 without a shadow
};

struct GBuffer {
  int width, height;
  std::vector<GBufferPixel> pixels;  // rows from the top

  GBuffer(int w, int h)
      : width(w), height(h), pixels(static_cast<size_t>(w) * static_cast<size_t>(h)) {}
  GBufferPixel& at(int x, int y) {
    return pixels[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)];
  }

  // Returns the pixel with smoothed light. On a surface, `sky` is averaged over neighbor pixels
  // near the surface's plane. `sun` and `normal` have finer detail, so nearer neighbors get more
  // weight. In a pixel without a surface, `floor` is averaged over neighbors without a surface.
  // `pixel_spread` is the width of a pixel at distance 1. Does not modify the buffer.
  GBufferPixel smoothed(int x, int y, double pixel_spread);
};

}  // namespace voxdag::query
