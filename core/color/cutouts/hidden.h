// Which texels and triangles a material cuts out. docs/color.md, "Cutouts", states the rule.
#pragma once

#include <algorithm>
#include <cstdint>

#include "core/color/intensity.h"
#include "core/color/surface.h"

namespace voxdag::color {

// Returns the alpha, 0 to 255, that the material's alpha mode makes of `alpha`, which is 0 to
// 65535.
VOXDAG_HD inline uint32_t alpha_by_mode(const Material& material, uint32_t alpha) {
  if (material.alpha_mode == AlphaMode::kOpaque) return 255;
  if (material.alpha_mode == AlphaMode::kMask) return alpha >= material.alpha_cutoff ? 255 : 0;
  return (alpha * 255 + 32768) >> 16;
}

// True if the material cuts out a texel with this alpha.
inline bool is_hidden(const Material& material, uint32_t texel_alpha) {
  return alpha_by_mode(material, scaled(texel_alpha, material.factor[3])) == 0;
}

// True if the material cuts out the complete triangle: even an opaque texel would be hidden at the
// corner with the largest alpha.
inline bool is_hidden(const Material& material, const FixedSurface& surface) {
  if (material.alpha_mode == AlphaMode::kOpaque) return false;
  uint32_t alpha = 0;
  for (const SurfaceCorner& corner : surface.corners)
    alpha = std::max<uint32_t>(alpha, corner.color[3]);
  return alpha_by_mode(material, scaled(material.factor[3], alpha)) == 0;
}

}  // namespace voxdag::color
