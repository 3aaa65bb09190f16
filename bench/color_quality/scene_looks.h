// The scene's appearance for the oracle: decoded images, materials and surfaces. It shares only the
// scene readers and the image decoders with voxdag's own code for colors.
#pragma once

#include <memory>
#include <vector>

#include "core/base/memory_budget.h"
#include "scene/triangle_source.h"
#include "tests/oracle/surface_color.h"

namespace voxdag {

class SceneLooks {
 public:
  // Decodes all images, with 16 bytes per texel. Ignores broken images.
  SceneLooks(const SceneMaterials& materials, MemoryBudget& budget);
  // The result refers to the materials in this object.
  oracle::Surface surface(const FixedSurface& surface) const;
  size_t texels() const;

 private:
  std::vector<std::unique_ptr<oracle::ColorImage>> images_;
  std::vector<oracle::SurfaceMaterial> materials_;
};

}  // namespace voxdag
