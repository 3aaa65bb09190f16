// KHR_texture_transform: offset + rotation * scale of texture coordinates, in IEEE doubles with
// + - * / and fmod only, so that all machines get the same bits.
#pragma once

#include <array>

namespace voxdag::gltf {

struct SineCosine {
  double sine = 0, cosine = 1;
};
// Returns sine and cosine of an angle in radians, to about 2^-50; of 0 if it is not finite.
SineCosine sine_and_cosine(double angle);

// Rows of a 2x3 matrix.
struct TextureTransform {
  double m[2][3] = {{1, 0, 0}, {0, 1, 0}};

  void apply(double& u, double& v) const {
    const double s = u, t = v;
    u = (m[0][0] * s + m[0][1] * t) + m[0][2];
    v = (m[1][0] * s + m[1][1] * t) + m[1][2];
  }
};

// First the scale, then the rotation, counterclockwise as an image with v downward shows it, then
// the offset.
TextureTransform make_texture_transform(const std::array<double, 2>& offset, double rotation,
                                        const std::array<double, 2>& scale);

}  // namespace voxdag::gltf
