// Bakes the regions of cubes of the color grid, for one thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/cancel_token.h"
#include "core/base/memory_budget.h"
#include "core/color/blocks/value_region.h"
#include "core/color/rule/bake_region.h"
#include "core/scene/textures/texture_set.h"
#include "scheduler/color/color_keys.h"
#include "scheduler/color/surface_store.h"

namespace voxdag {

class CubeBaker {
 public:
  // For each attribute the records (region_record.h) of regions.
  using Records = std::vector<std::vector<std::byte>>;

  // Charges ColorMemory::region_bytes(); a region that is solid takes more, for as long as it is
  // baked. Surfaces in memory take up to `surface_bytes`. The references must outlive it.
  CubeBaker(const ColorGrid& grid, std::span<const StoredAttribute> attributes,
            std::span<const Material> materials, TextureReader& textures, SurfaceStore& store,
            uint64_t surface_bytes, MemoryBudget& budget, const CancelToken& cancel);

  // Appends the records of the regions with surfaces in Morton order, and clears the bin, which has
  // all surfaces that touch the cube. `records`: in the order of the attributes.
  void bake(const Cube& cube, SurfaceStore::Bin& bin, Records& records);

 private:
  void divide(const Cube& cube, SurfaceStore::Bin& bin, Records& records);
  void descend(const Cube& cube, std::span<const uint32_t> touching, Records& records);
  void bake_region(const Cube& region, std::span<const uint32_t> touching, Records& records);
  void bake_in_parts(const Cube& region, SurfaceStore::Bin& bin, Records& records);
  void append(const Cube& region, Records& records);

  EncodedRegion encode(const StoredAttribute& attribute, uint64_t morton);

  const ColorGrid grid_;
  const std::span<const StoredAttribute> attributes_;
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
  std::vector<CellValues> values_;
  std::vector<ValuedCell> valued_;  // of one attribute
};

}  // namespace voxdag
