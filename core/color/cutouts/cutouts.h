// The cutouts of a scene: for each material, the texels that it makes invisible (cuts out).
#pragma once

#include <cstdint>
#include <vector>

#include "core/color/cutouts/alpha_mask.h"
#include "core/color/surface.h"

namespace voxdag {

struct Cutouts {
  static constexpr uint32_t kNoMask = UINT32_MAX;

  std::vector<Material> materials;  // the scene's materials
  std::vector<AlphaMask> masks;
  // For each material, the index of its mask; kNoMask if the material cuts out no texel.
  std::vector<uint32_t> mask_of;

  const AlphaMask* mask(uint32_t material) const {
    return mask_of[material] == kNoMask ? nullptr : &masks[mask_of[material]];
  }
  // True if triangles of the material can be cut out, in part or completely.
  bool may_cut(uint32_t material) const {
    return materials[material].alpha_mode != AlphaMode::kOpaque;
  }
};

}  // namespace voxdag
