// Converts a scene's images, materials and surfaces for the oracle (tests/oracle), a second
// implementation of the color rule. The oracle must not share code with voxdag's colors, so this
// file uses only the scene readers and the image decoders.
#pragma once

#include <memory>
#include <vector>

#include "core/base/memory_budget.h"
#include "scene/triangle_source.h"
#include "tests/oracle/surface_color.h"

namespace voxdag {

class SceneLooks {
 public:
  // Decodes all images, with 16 bytes per texel. Prints a message for each image that it cannot
  // decode; the materials that use this image are then treated as materials without an image.
  SceneLooks(const SceneMaterials& materials, MemoryBudget& budget);
  // Converts a surface. The result refers to this object's materials.
  oracle::Surface surface(const FixedSurface& surface) const;
  size_t texels() const;

 private:
  std::vector<std::unique_ptr<oracle::ColorImage>> images_;
  std::vector<oracle::SurfaceMaterial> materials_;
};

}  // namespace voxdag
