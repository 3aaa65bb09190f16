// Bakes the regions of cubes of the color grid, for one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/cancel_token.h"
#include "core/base/memory_budget.h"
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

  // Appends the records (region_record.h) of the regions with surfaces in Morton order, and clears
  // the bin, which has all surfaces that touch the cube.
  void bake(const Cube& cube, SurfaceStore::Bin& bin, std::vector<std::byte>& records);

 private:
  void divide(const Cube& cube, SurfaceStore::Bin& bin, std::vector<std::byte>& records);
  void descend(const Cube& cube, std::span<const uint32_t> touching,
               std::vector<std::byte>& records);
  void bake_region(const Cube& region, std::span<const uint32_t> touching,
                   std::vector<std::byte>& records);
  void bake_in_parts(const Cube& region, SurfaceStore::Bin& bin, std::vector<std::byte>& records);
  void append(const Cube& region, std::vector<std::byte>& records);

  const ColorGrid grid_;
  SurfaceStore& store_;
  const uint64_t surface_bytes_;
  MemoryBudget& budget_;
  const CancelToken& cancel_;
  const MemoryCharge charge_;
  MemoryCharge records_charge_;  // for the largest records so far
  RegionBaker<TextureReader> baker_;
  std::vector<FixedSurface> surfaces_;  // of the cube
  std::vector<FixedSurface> touching_;  // of a region, or a part of them
  std::vector<ColoredCell> cells_;
};

}  // namespace voxdag
