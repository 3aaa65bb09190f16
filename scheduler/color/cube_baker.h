// Bakes the regions of cubes of the color grid, for one thread.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/cancel_token.h"
#include "core/base/memory_budget.h"
#include "core/color/blocks/region.h"
#include "core/color/rule/bake_region.h"
#include "core/scene/textures/texture_set.h"
#include "scheduler/color/surface_store.h"

namespace voxdag {

class CubeBaker {
 public:
  // Charges ColorMemory::kRegionBytes; a region that is solid takes more, for as long as it is
  // baked. Surfaces in memory take up to `surface_bytes`. The references must outlive it.
  CubeBaker(const ColorGrid& grid, std::span<const Material> materials, TextureReader& textures,
            SurfaceStore& store, uint64_t surface_bytes, MemoryBudget& budget,
            const CancelToken& cancel);

  // Appends the regions with surfaces in Morton order, and clears the bin, which has all surfaces
  // that touch the cube. Throws Error{kOutOfMemory} naming a region whose surfaces do not fit.
  void bake(const Cube& cube, SurfaceStore::Bin& bin, std::vector<EncodedRegion>& regions);

 private:
  void divide(const Cube& cube, SurfaceStore::Bin& bin, std::vector<EncodedRegion>& regions);
  void descend(const Cube& cube, std::span<const uint32_t> touching,
               std::vector<EncodedRegion>& regions);
  void bake_region(const Cube& region, std::span<const uint32_t> touching,
                   std::vector<EncodedRegion>& regions);

  const ColorGrid grid_;
  SurfaceStore& store_;
  const uint64_t surface_bytes_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
  const MemoryCharge charge_;
  RegionBaker<TextureReader> baker_;
  std::vector<FixedSurface> surfaces_;  // of the cube
  std::vector<FixedSurface> touching_;  // of a region
  std::vector<ColoredCell> cells_;
};

}  // namespace voxdag
