// KHR_texture_transform: scales and rotates texture coordinates and adds an offset. Uses only
// IEEE doubles with + - * / and fmod, so that all machines get the same bits.
#pragma once

#include <array>

namespace voxdag::gltf {

struct SineCosine {
  double sine = 0, cosine = 1;
};
// Returns sine and cosine of an angle in radians, with an error of about 2^-50. An angle that is
// not finite counts as 0.
SineCosine sine_and_cosine(double angle);

// A transform of texture coordinates (u, v): the rows of the 2x3 matrix that multiplies (u, v, 1).
struct TextureTransform {
  double m[2][3] = {{1, 0, 0}, {0, 1, 0}};

  void apply(double& u, double& v) const {
    const double s = u, t = v;
    u = (m[0][0] * s + m[0][1] * t) + m[0][2];
    v = (m[1][0] * s + m[1][1] * t) + m[1][2];
  }
};

// Returns the transform that scales first, then rotates (counterclockwise in an image whose v
// points downward), then adds the offset.
TextureTransform make_texture_transform(const std::array<double, 2>& offset, double rotation,
                                        const std::array<double, 2>& scale);

}  // namespace voxdag::gltf
