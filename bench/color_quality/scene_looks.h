// The scene's appearance for the oracle: decoded images, materials and surfaces. Only the scene
// readers and the image decoders are shared with the product.
#pragma once

#include <memory>
#include <vector>

#include "core/base/memory_budget.h"
#include "scene/triangle_source.h"
#include "tests/oracle/surface_color.h"

namespace voxdag {

class SceneLooks {
 public:
  // Decodes all images, 16 bytes a texel. An image that is broken is not used.
  SceneLooks(const SceneMaterials& materials, MemoryBudget& budget);
  // Refers to the materials here.
  oracle::Surface surface(const FixedSurface& surface) const;
  size_t texels() const;

 private:
  std::vector<std::unique_ptr<oracle::ColorImage>> images_;
  std::vector<oracle::SurfaceMaterial> materials_;
};

}  // namespace voxdag
